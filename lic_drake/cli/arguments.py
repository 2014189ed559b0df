"""What subcommands share when they declare their arguments."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    type Subparsers = argparse._SubParsersAction[argparse.ArgumentParser]
else:
    Subparsers = argparse._SubParsersAction  # Takes no brackets where programs run.
"""What `add_parser` of a subcommand gets."""


def positive_int(text: str) -> int:
    """Reads a whole number of 1 or more; for `type=` of an argument."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"needs a whole number of 1 or more, got {text!r}")
    return value


def non_negative_int(text: str) -> int:
    """Reads a whole number of 0 or more; for `type=` of an argument."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"needs a whole number of 0 or more, got {text!r}")
    return value


def add_scenario_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds --scenario and --set."""
    parser.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        default="cylinder-clutter",
        help="shipped scenario or path of a .yaml file (default: %(default)s)",
    )
    parser.add_argument(
        "--set",
        metavar="YAML",
        default="",
        help='values put over the scenario, for instance "{stop: {timeout_s: 20}}", SI units'
        " (default: none)",
    )


def add_method_argument(parser: argparse.ArgumentParser) -> None:
    """Adds --method, the strategy that selects."""
    parser.add_argument(
        "--method",
        default="gp",
        metavar="NAME",
        help="strategy that selects: rnd, cost, knn or gp (default: %(default)s)",
    )


def add_library_argument(
    parser: argparse.ArgumentParser, default: str = "the shipped one for cylinder-clutter"
) -> None:
    """Adds --library, what strategies learn from."""
    parser.add_argument(
        "--library",
        type=Path,
        metavar="FOLDER",
        help=f"experience library (default: {default})",
    )


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Adds --json, for output that a machine reads."""
    parser.add_argument("--json", action="store_true", help="print one JSON object (default: text)")
