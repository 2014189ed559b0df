"""`lic experience`: inspects, checks, recomputes, merges and extends experience libraries."""

import argparse
import shlex
from pathlib import Path
from typing import Any

from lic_drake.cli.arguments import (
    INCOMPLETE,
    Subparsers,
    add_command,
    add_count,
    print_result,
)
from lic_drake.paths import find_library


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand and its actions to the command line."""
    parser = subparsers.add_parser(
        "experience",
        help="inspect, check, recompute, merge or extend experience libraries",
        description="Works on experience libraries: folders of Parquet files with one row per"
        " reach, which also open in pandas. Shipped libraries may be given by name.",
        epilog="example: lic experience info cylinder-clutter",
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    info = add_command(
        actions,
        "info",
        run_info,
        "summarise a library",
        "Prints its size, success rate with 90 % Wilson interval, outcomes and origin.",
        "lic experience info out/cylinder --json",
        ["--json"],
    )
    check = add_command(
        actions,
        "check",
        run_check,
        "report missing, duplicate and damaged data",
        "Says what to do. Exit code 1 if a file is damaged, a reach is duplicated, scenarios are"
        " mixed, or a reach requested from lic collect is missing.",
        "lic experience check out/cylinder",
        ["--json"],
    )
    recompute = add_command(
        actions,
        "recompute",
        run_recompute,
        "simulate random rows again and compare them bit for bit",
        "Exit code 1 if a field other than the wall time differs. Meant for the machine that"
        " collected the library, as other processors round differently.",
        "lic experience recompute out/cylinder --rows 200",
        ["--seed"],
    )
    add_count(recompute, "--rows", 100, "maximum number of rows to simulate")
    merge = add_command(
        actions,
        "merge",
        run_merge,
        "merge libraries of one scenario into one file",
        "The Parquet file is itself a library. Identical duplicates are written once; conflicting"
        " ones are refused.",
        "lic experience merge out/all.parquet out/machine-1 out/machine-2",
    )
    merge.add_argument("output", metavar="OUTPUT", type=Path, help="new .parquet file")
    merge.add_argument(
        "sources", metavar="LIBRARY", type=find_library, nargs="+", help="folder, file or name"
    )
    add = add_command(
        actions,
        "add",
        run_add,
        "add rows of a real or another simulated robot to a library",
        "Estimators learn from them like from any other row. The CSV or Parquet file has columns"
        " named as in the library, in SI units and radians: in the plane at least success, goal_x,"
        " goal_y, start_y, start_phi; in space also goal_z, start_x, start_z, base_y, torso, and"
        " start_qw to start_qz instead of start_phi.",
        "lic experience add out/mine lab.csv --source lab-arm --weight 4",
    )
    for command in (info, check, recompute, add):
        command.add_argument(
            "library",
            metavar="LIBRARY",
            type=find_library,
            help="folder or .parquet file of the library, or name of a shipped one",
        )
    add.add_argument("file", metavar="FILE", type=Path, help=".csv or .parquet file of rows")
    add.add_argument(
        "--source",
        metavar="NAME",
        required=True,
        help="where the rows come from, e.g. lab-arm (no default: required)",
    )
    add.add_argument(
        "--weight",
        metavar="W",
        type=float,
        default=1,
        help="number of simulated reaches that a row counts as, 0.001 to 1000 (default: 1)",
    )


def run_info(args: argparse.Namespace) -> int:
    """Prints a library's summary."""
    from lic_drake.experience.check import summarize
    from lic_drake.experience.store import ExperienceLibrary

    print_result(args, summarize(ExperienceLibrary(args.library)))
    return 0


def run_check(args: argparse.Namespace) -> int:
    """Prints what a library holds and lacks; returns 1 if anything is wrong."""
    from lic_drake.experience.check import check_library
    from lic_drake.experience.collect import REQUEST_FILE, read_request
    from lic_drake.experience.store import ExperienceLibrary

    path = args.library / REQUEST_FILE
    request = read_request(path) if path.exists() else None
    report = check_library(ExperienceLibrary(args.library), request)
    print_result(args, {**report, "verdict": _verdict(report, args.library)})
    return 0 if report["is_sound"] else INCOMPLETE


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
    print(f"{len(compared) - len(differing)} of {len(compared)} rows are identical to the last bit")
    for old, new, names in differing:
        print(f"{old.key}: {old.outcome} -> {new.outcome}, different {', '.join(names)}")
    return INCOMPLETE if differing else 0


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
    print(
        f"added {len(rows)} rows from {args.source}, {sum(row.success for row in rows)} of them"
        f" successes, with a weight of {args.weight:g} simulated reaches each:"
        f" {library.shard_path(rows[0].stream)}"
    )
    return 0


def _verdict(report: dict[str, Any], library: Path) -> str:
    resume = f"lic collect {shlex.quote(str(library))}"
    if report["damaged"] and library.is_dir():
        aside = shlex.quote(str(library / "_damaged"))
        names = shlex.join(str(library / name) for name in report["damaged"])
        return f"DAMAGED; repair with: mkdir -p {aside} && mv {names} {aside} && {resume}"
    if report["damaged"]:
        return "DAMAGED; restore the file, or collect its reaches again"
    if len(report["scenarios"]) > 1:
        return "MIXED; keep one library per scenario"
    if report["duplicates"]:
        return "DUPLICATES; merge into a new library: lic experience merge --help"
    if report["missing"]:
        return f"INCOMPLETE; resume with: {resume}"
    return "sound" if report["requested"] is None else "complete"
