"""`lic experience add`: adds records of real or other simulated robots to a library."""

import argparse
import json
from pathlib import Path

from lic_drake.cli.arguments import Subparsers, add_json_argument


def add_parser(actions: Subparsers) -> None:
    """Adds the action to `lic experience`."""
    parser = actions.add_parser(
        "add",
        help="add records of real or other simulated robots to a library",
        description="Adds records of real or other simulated robots to a library, beside its"
        " simulated reaches. Whatever learns from the library learns from them, too, without"
        " choosing its settings anew. A record is a row of a CSV or Parquet file with columns"
        " named as those of the library, in SI units and radians: in the plane success, goal_x,"
        " goal_y, start_y, start_phi, and if known start_x, base_x, base_y, environment, final_x,"
        " final_y, final_phi, final_vx, final_vy; for the PR2 also goal_z, start_z, torso and the"
        " quaternion start_qw to start_qz instead of start_phi. All rows are checked before"
        " anything is written.",
        epilog="example: lic experience add out/mine lab.csv --source lab-arm --weight 4",
    )
    parser.add_argument("library", metavar="LIBRARY", type=Path, help="folder of the library")
    parser.add_argument("file", metavar="FILE", type=Path, help=".csv or .parquet file of records")
    parser.add_argument(
        "--source",
        metavar="NAME",
        required=True,
        help="who made the records, for instance lab-arm (no default: must be given)",
    )
    parser.add_argument(
        "--weight",
        metavar="W",
        type=_number,
        default=1,
        help="how many simulated reaches a record counts as, 0.001 to 1000 (default: %(default)s)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"needs a number, got {text!r}") from None


def run(args: argparse.Namespace) -> int:
    """Adds the records of a file."""
    from lic_drake.experience.added import add_file
    from lic_drake.experience.store import ExperienceLibrary

    library = ExperienceLibrary(args.library)
    addition = add_file(library, args.file, source=args.source, weight=args.weight)
    if args.json:
        print(json.dumps(addition.values()))
    else:
        print(f"added {addition.describe()}")
    return 0
