"""`lic demo`: select with LIC-1, reach, record."""

import argparse
from pathlib import Path

from lic_drake.cli.arguments import (
    Subparsers,
    add_library_argument,
    add_method_argument,
    non_negative_int,
)


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "demo",
        help="select a start from past experience, reach into unseen clutter, record it",
        description="Draws an environment that is in no library, selects a start pose from the"
        " shipped experience library, reaches, and tries once more from elsewhere if that fails."
        " Writes demo.html (a recording that plays offline), density.png (estimated success over"
        " the starts), path.png (view from above) and demo.json.",
        epilog="example: lic demo --seed 7 --method knn --out out",
    )
    parser.add_argument(
        "--seed",
        type=non_negative_int,
        default=0,
        metavar="N",
        help="chooses environment and goal (default: 0)",
    )
    add_method_argument(parser)
    add_library_argument(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("out"), help="folder to write to (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.evaluate.demonstration import demonstrate
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library

    library = ExperienceLibrary(args.library or shipped_library("cylinder-clutter"))
    result = demonstrate(library.scenario(), library, args.method, args.seed, args.out)
    for kind, path in result.files.items():
        print(f"{kind}: {path}")
    return 0
