"""`lic experience`: looks at, checks, recomputes, merges and adds to experience libraries."""

import argparse
import dataclasses
import json
import os
import shlex
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli import add_to_library, exit_codes
from lic_drake.cli.arguments import Subparsers, add_json_argument, positive_int

if TYPE_CHECKING:
    from lic_drake.experience.check import LibraryReport
    from lic_drake.experience.summary import LibrarySummary


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "experience",
        help="look at, check, recompute, merge or add to experience libraries",
        description="Looks at, checks, recomputes, merges or adds to experience libraries: folders"
        " of Parquet files with one row per reach, which also open in pandas.",
        epilog="example: lic experience info out/cylinder",
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    _add_info(actions)
    _add_check(actions)
    _add_recompute(actions)
    _add_merge(actions)
    add_to_library.add_parser(actions)


def _add_info(actions: Subparsers) -> None:
    parser = actions.add_parser(
        "info",
        help="summarize a library",
        description="Prints the size, success rate with 90 % Wilson interval, outcomes and origin"
        " of a library.",
        epilog="example: lic experience info out/cylinder --json",
    )
    _add_library(parser)
    add_json_argument(parser)
    parser.set_defaults(run=run_info)


def _add_check(actions: Subparsers) -> None:
    parser = actions.add_parser(
        "check",
        help="say what is there, what is missing and what is damaged",
        description="Reads every file of a library in full and says what to do. Exit code 1 if a"
        " file is damaged, a reach is there twice, scenarios are mixed, or a reach is missing.",
        epilog="example: lic experience check out/cylinder",
    )
    _add_library(parser)
    parser.add_argument(
        "--request",
        metavar="FILE",
        type=Path,
        help="collection request that the library must fulfil (default: the library's own)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run_check)


def _add_recompute(actions: Subparsers) -> None:
    parser = actions.add_parser(
        "recompute",
        help="simulate random rows again and compare them bit for bit",
        description="Simulates random rows of a library again. Exit code 1 if any differs in any"
        " bit of any field but the wall time. Meant for the machine that collected the library:"
        " other processors round otherwise.",
        epilog="example: lic experience recompute out/cylinder --rows 200",
    )
    _add_library(parser)
    parser.add_argument(
        "--rows",
        metavar="N",
        type=positive_int,
        default=100,
        help="number of rows to simulate (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="draws the rows (default: %(default)s)"
    )
    parser.set_defaults(run=run_recompute)


def _add_merge(actions: Subparsers) -> None:
    parser = actions.add_parser(
        "merge",
        help="merge libraries of one scenario into one file",
        description="Writes all reaches of libraries of one scenario into one Parquet file, which"
        " is a library of its own. Equal duplicates are written once, unequal ones refused."
        " Records that were added from elsewhere stay where they are.",
        epilog="example: lic experience merge out/all.parquet out/machine-1 out/machine-2",
    )
    parser.add_argument("output", metavar="OUTPUT", type=Path, help="new .parquet file")
    parser.add_argument(
        "sources", metavar="LIBRARY", type=Path, nargs="+", help="folder or file of a library"
    )
    parser.set_defaults(run=run_merge)


def _add_library(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "library", metavar="LIBRARY", type=Path, help="folder or .parquet file of the library"
    )


def run_info(args: argparse.Namespace) -> int:
    """Prints a library's summary."""
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.experience.summary import summarize

    summary = summarize(ExperienceLibrary(args.library))
    if args.json:
        values = {**dataclasses.asdict(summary), "success_rate": summary.success_rate}
        values["added"] = [addition.values() for addition in summary.added]
        print(json.dumps(values, indent=2))
    else:
        print("\n".join(_lines(args.library, summary)))
    return 0


def run_check(args: argparse.Namespace) -> int:
    """Prints what a library holds and lacks; returns 1 if anything is wrong."""
    from lic_drake.experience.check import check_library
    from lic_drake.experience.grid import REQUEST_FILE, read_request
    from lic_drake.experience.store import ExperienceLibrary

    path = args.request or args.library / REQUEST_FILE
    request = read_request(path) if args.request or os.path.exists(path) else None
    report = check_library(ExperienceLibrary(args.library), request)
    if args.json:
        print(json.dumps({**dataclasses.asdict(report), "is_sound": report.is_sound}, indent=2))
        return 0 if report.is_sound else exit_codes.INCOMPLETE
    print("\n".join(_check_lines(report, args.library, is_own=not args.request)))
    return 0 if report.is_sound else exit_codes.INCOMPLETE


def run_recompute(args: argparse.Namespace) -> int:
    """Simulates rows again; returns 1 if one differs."""
    import numpy as np
    from tqdm import tqdm

    from lic_drake.experience.recompute import recompute
    from lic_drake.experience.store import ExperienceLibrary

    library, rng = ExperienceLibrary(args.library), np.random.default_rng(args.seed)
    with tqdm(total=args.rows, disable=None, unit="rows") as bar:
        differing = recompute(library, args.rows, rng, progress=lambda _: bar.update())
    print(f"{args.rows - len(differing)} of {args.rows} rows are the same to the last bit")
    for row in differing:
        print(f"{row.key}: {' -> '.join(row.outcomes)}, other {', '.join(row.fields)}")
    return exit_codes.INCOMPLETE if differing else 0


def run_merge(args: argparse.Namespace) -> int:
    """Merges libraries."""
    from lic_drake.experience.merge import merge_libraries
    from lic_drake.experience.store import ExperienceLibrary

    rows = merge_libraries([ExperienceLibrary(path) for path in args.sources], args.output)
    print(f"{rows} reaches in {args.output}")
    return 0


def _check_lines(report: "LibraryReport", library: Path, is_own: bool) -> list[str]:
    """Returns the lines of a report; the last one is the verdict, with what to do."""
    lines = [
        f"reaches     {report.reaches} in {report.shards} files",
        f"journals    {report.journalled} more reaches of tasks at work or interrupted"
        + (f"; {report.lost_lines} damaged lines" if report.lost_lines else ""),
        *([f"added       {report.added} records from elsewhere"] if report.added else []),
        f"missing     {_missing(report)}",
        f"scenarios   {', '.join(report.scenarios) or 'none'}",
        f"duplicates  {len(report.duplicates)} {' '.join(report.duplicates[:5])}".rstrip(),
        f"damaged     {len(report.damaged)}",
        *(f"            {file.reason}" for file in report.damaged),
    ]
    go_on = f"lic collect {shlex.quote(str(library))}"
    if report.damaged and library.is_dir():
        aside = shlex.quote(str(library / "_damaged"))
        names = shlex.join(str(library / file.name) for file in report.damaged)
        lines.append(f"DAMAGED; repair with: mkdir -p {aside} && mv {names} {aside} && {go_on}")
    elif report.damaged:
        lines.append("DAMAGED; restore the file, or collect its reaches again")
    elif len(report.scenarios) > 1:
        lines.append("MIXED; keep one library per scenario")
    elif report.duplicates:
        lines.append("DUPLICATES; merge into a new library: lic experience merge --help")
    elif report.missing:
        lines.append(f"INCOMPLETE; go on with: {go_on}" if is_own else "INCOMPLETE")
    else:
        lines.append("sound" if report.requested is None else "complete")
    return lines


def _missing(report: "LibraryReport") -> str:
    """Returns how many reaches are missing, and in which environments."""
    if report.missing is None:
        return "unknown, without a request"
    if report.missing == 0:
        return f"0 of {report.requested}"
    # Consecutive indices differ from their rank by the same number.
    runs = [
        [index for _, index in group]
        for _, group in groupby(enumerate(report.incomplete), lambda pair: pair[1] - pair[0])
    ]
    spans = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    return f"{report.missing} of {report.requested}, in environments {', '.join(spans)}"


def _lines(library: Path, summary: "LibrarySummary") -> list[str]:
    """Returns the lines of a summary."""
    low, high = summary.success_interval
    outcomes = ", ".join(f"{name} {count}" for name, count in summary.outcomes.items())
    return [
        f"library       {library} ({summary.shards} shards)",
        f"scenario      {summary.category}, {summary.robot}, digest {summary.scenario}",
        f"reaches       {summary.reaches}, and {summary.journalled} in journals",
        f"grid          {summary.environments} environments ({', '.join(summary.streams)}),"
        f" {summary.goals} goals, {summary.starts} starts",
        f"success       {summary.successes} of {summary.reaches} = {summary.success_rate:.1%}"
        f" (90 % interval {low:.1%} to {high:.1%})",
        f"outcomes      {outcomes}",
        f"time          {summary.simulated_s / 3600.0:.3g} h simulated in"
        f" {summary.wall_time_s / 3600.0:.3g} h of wall time",
        f"simulated by  lic_drake {', '.join(summary.lic_drake_versions)};"
        f" Drake {', '.join(summary.drake_versions)}",
        *(f"added         {addition.describe()}" for addition in summary.added),
    ]
