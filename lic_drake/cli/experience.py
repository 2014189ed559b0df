"""`lic experience`: looks at, checks, recomputes, merges and adds to experience libraries."""

import argparse
import json
import os
import shlex
from itertools import groupby
from pathlib import Path
from typing import Any

from lic_drake.cli import exit_codes
from lic_drake.cli.arguments import Subparsers, add_json_argument, library_path, positive_int


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "experience",
        help="look at, check, recompute, merge or add to experience libraries",
        description="Looks at, checks, recomputes, merges or adds to experience libraries: folders"
        " of Parquet files with one row per reach, which also open in pandas. A shipped library"
        " goes by its name.",
        epilog="example: lic experience info cylinder-clutter",
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    info = actions.add_parser(
        "info",
        help="summarize a library",
        description="Prints the size, success rate with 90 % Wilson interval, outcomes and origin"
        " of a library.",
        epilog="example: lic experience info out/cylinder --json",
    )
    _add_library(info)
    add_json_argument(info)
    info.set_defaults(run=run_info)
    check = actions.add_parser(
        "check",
        help="say what is there, what is missing and what is damaged",
        description="Reads every file of a library in full and says what to do. Exit code 1 if a"
        " file is damaged, a reach is there twice, scenarios are mixed, or a reach is missing that"
        " lic collect was asked for.",
        epilog="example: lic experience check out/cylinder",
    )
    _add_library(check)
    add_json_argument(check)
    check.set_defaults(run=run_check)
    recompute = actions.add_parser(
        "recompute",
        help="simulate random rows again and compare them bit for bit",
        description="Simulates random rows of a library again. Exit code 1 if any differs in any"
        " bit of any field but the wall time. Meant for the machine that collected the library:"
        " other processors round otherwise.",
        epilog="example: lic experience recompute out/cylinder --rows 200",
    )
    _add_library(recompute)
    recompute.add_argument(
        "--rows",
        metavar="N",
        type=positive_int,
        default=100,
        help="number of rows to simulate, all if there are fewer (default: %(default)s)",
    )
    recompute.add_argument(
        "--seed", metavar="N", type=int, default=0, help="draws the rows (default: %(default)s)"
    )
    recompute.set_defaults(run=run_recompute)
    merge = actions.add_parser(
        "merge",
        help="merge libraries of one scenario into one file",
        description="Writes all rows of libraries of one scenario into one Parquet file, which is"
        " a library of its own. Equal duplicates are written once, unequal ones refused.",
        epilog="example: lic experience merge out/all.parquet out/machine-1 out/machine-2",
    )
    merge.add_argument("output", metavar="OUTPUT", type=Path, help="new .parquet file")
    merge.add_argument(
        "sources", metavar="LIBRARY", type=library_path, nargs="+", help="folder, file or name"
    )
    merge.set_defaults(run=run_merge)
    _add_add(actions)


def _add_add(actions: Subparsers) -> None:
    parser = actions.add_parser(
        "add",
        help="add rows of a real or another simulated robot to a library",
        description="Adds rows of a real or another simulated robot to a library, as a file of"
        " their own with a source and a weight. Whatever learns from the library learns from them,"
        " too. They come from a CSV or Parquet file with columns named as those of the library, in"
        " SI units and radians: in the plane success, goal_x, goal_y, start_y, start_phi, and if"
        " known start_x, base_x, base_y, environment, final_x, final_y, final_phi, final_vx,"
        " final_vy; for the PR2 also goal_z, start_x, start_z, base_y, torso and the quaternion"
        " start_qw to start_qz instead of start_phi. All rows are checked before anything is"
        " written.",
        epilog="example: lic experience add out/mine lab.csv --source lab-arm --weight 4",
    )
    parser.add_argument("library", metavar="LIBRARY", type=Path, help="folder of the library")
    parser.add_argument("file", metavar="FILE", type=Path, help=".csv or .parquet file of rows")
    parser.add_argument(
        "--source",
        metavar="NAME",
        required=True,
        help="who made the rows, for instance lab-arm (no default: must be given)",
    )
    parser.add_argument(
        "--weight",
        metavar="W",
        type=_number,
        default=1,
        help="how many simulated reaches a row counts as, 0.001 to 1000 (default: %(default)s)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run_add)


def _add_library(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "library",
        metavar="LIBRARY",
        type=library_path,
        help="folder or .parquet file of the library, or name of a shipped one",
    )


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"needs a number, got {text!r}") from None


def run_info(args: argparse.Namespace) -> int:
    """Prints a library's summary."""
    from lic_drake.experience.check import summarize
    from lic_drake.experience.store import ExperienceLibrary

    summary = summarize(ExperienceLibrary(args.library))
    if args.json:
        print(json.dumps(summary, indent=2))
    else:
        print("\n".join(_lines(args.library, summary)))
    return 0


def run_check(args: argparse.Namespace) -> int:
    """Prints what a library holds and lacks; returns 1 if anything is wrong."""
    from lic_drake.experience.check import check_library
    from lic_drake.experience.collect import REQUEST_FILE, read_request
    from lic_drake.experience.store import ExperienceLibrary

    path = args.library / REQUEST_FILE
    request = read_request(path) if os.path.exists(path) else None
    report = check_library(ExperienceLibrary(args.library), request)
    if args.json:
        print(json.dumps(report, indent=2))
    else:
        print("\n".join(_check_lines(report, args.library)))
    return 0 if report["is_sound"] else exit_codes.INCOMPLETE


def run_recompute(args: argparse.Namespace) -> int:
    """Simulates rows again; returns 1 if one differs."""
    import numpy as np
    from tqdm import tqdm

    from lic_drake.experience.check import recompute
    from lic_drake.experience.store import ExperienceLibrary

    library, rng = ExperienceLibrary(args.library), np.random.default_rng(args.seed)
    rows = recompute(library, args.rows, rng)
    compared = list(tqdm(rows, total=args.rows, disable=None, unit="rows"))
    differing = [result for result in compared if result[2]]
    print(f"{len(compared) - len(differing)} of {len(compared)} rows are the same to the last bit")
    for old, new, names in differing:
        print(f"{old.key}: {old.outcome} -> {new.outcome}, other {', '.join(names)}")
    return exit_codes.INCOMPLETE if differing else 0


def run_merge(args: argparse.Namespace) -> int:
    """Merges libraries."""
    from lic_drake.experience.store import ExperienceLibrary, merge_libraries

    rows = merge_libraries([ExperienceLibrary(path) for path in args.sources], args.output)
    print(f"{rows} reaches in {args.output}")
    return 0


def run_add(args: argparse.Namespace) -> int:
    """Adds the rows of a file."""
    from lic_drake.experience.add import add_rows, read_rows
    from lic_drake.experience.store import ExperienceLibrary

    library = ExperienceLibrary(args.library)
    rows = add_rows(library, read_rows(args.file), source=args.source, weight=args.weight)
    successes, path = sum(row.success for row in rows), library.shard_path(rows[0].stream)
    if args.json:
        print(json.dumps({"rows": len(rows), "successes": successes, "path": str(path)}))
    else:
        print(
            f"added {len(rows)} rows of {args.source}, {successes} at the goal, each with the"
            f" weight of {args.weight:g} simulated reaches: {path}"
        )
    return 0


def _check_lines(report: dict[str, Any], library: Path) -> list[str]:
    """Returns the lines of a report; the last one is the verdict, with what to do."""
    lines = [
        f"reaches     {report['reaches']} in {report['shards']} files",
        f"missing     {_missing(report)}",
        f"scenarios   {', '.join(report['scenarios']) or 'none'}",
        f"duplicates  {len(report['duplicates'])} {' '.join(report['duplicates'][:5])}".rstrip(),
        f"damaged     {len(report['damaged'])}",
        *(f"            {reason}" for reason in report["damaged"].values()),
    ]
    go_on = f"lic collect {shlex.quote(str(library))}"
    if report["damaged"] and library.is_dir():
        aside = shlex.quote(str(library / "_damaged"))
        names = shlex.join(str(library / name) for name in report["damaged"])
        lines.append(f"DAMAGED; repair with: mkdir -p {aside} && mv {names} {aside} && {go_on}")
    elif report["damaged"]:
        lines.append("DAMAGED; restore the file, or collect its reaches again")
    elif len(report["scenarios"]) > 1:
        lines.append("MIXED; keep one library per scenario")
    elif report["duplicates"]:
        lines.append("DUPLICATES; merge into a new library: lic experience merge --help")
    elif report["missing"]:
        lines.append(f"INCOMPLETE; go on with: {go_on}")
    else:
        lines.append("sound" if report["requested"] is None else "complete")
    return lines


def _missing(report: dict[str, Any]) -> str:
    """Returns how many reaches are missing, and in which environments."""
    if report["missing"] is None:
        return "unknown, without a request"
    if report["missing"] == 0:
        return f"0 of {report['requested']}"
    # Consecutive indices differ from their rank by the same number.
    runs = [
        [index for _, index in group]
        for _, group in groupby(enumerate(report["incomplete"]), lambda pair: pair[1] - pair[0])
    ]
    spans = [str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs]
    return f"{report['missing']} of {report['requested']}, in environments {', '.join(spans)}"


def _lines(library: Path, summary: dict[str, Any]) -> list[str]:
    """Returns the lines of a summary."""
    low, high = summary["success_interval"]
    outcomes = ", ".join(f"{name} {count}" for name, count in summary["outcomes"].items())
    return [
        f"library       {library} ({summary['shards']} shards)",
        f"scenario      {summary['category']}, {summary['robot']}, digest {summary['scenario']}",
        f"reaches       {summary['reaches']}",
        f"grid          {summary['environments']} environments ({', '.join(summary['streams'])}),"
        f" {summary['goals']} goals, {summary['starts']} starts",
        f"success       {summary['successes']} of {summary['reaches']}"
        f" = {summary['success_rate']:.1%} (90 % interval {low:.1%} to {high:.1%})",
        f"outcomes      {outcomes}",
        f"simulated by  lic_drake {', '.join(summary['lic_drake_versions'])};"
        f" Drake {', '.join(summary['drake_versions'])}",
        *(
            f"added         {added['reaches']} rows of {source}, {added['successes']} at the goal,"
            f" weight {' or '.join(f'{weight:g}' for weight in added['weights'])}"
            for source, added in summary["added"].items()
        ),
    ]
