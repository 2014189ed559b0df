"""What subcommands share when they declare their arguments."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lic_drake.experience.workers import Workers

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


def library_path(text: str) -> Path:
    """Reads a library's folder or file, or the name of a shipped one; for `type=`."""
    from lic_drake.paths import find_library

    return find_library(text)


def add_library_argument(
    parser: argparse.ArgumentParser, default: str = "the shipped one for cylinder-clutter"
) -> None:
    """Adds --library, what strategies learn from."""
    parser.add_argument(
        "--library",
        type=library_path,
        metavar="NAME|FOLDER",
        help=f"experience library: a folder, or the name of a shipped one (default: {default})",
    )


def add_workers_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds --workers and --scheduler, where reaches are simulated."""
    parser.add_argument(
        "--workers",
        metavar="N",
        type=positive_int,
        help="number of environments at work at a time; a process takes 200 MB of memory (default:"
        " CPU count, or all workers of the scheduler)",
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="simulate on the workers of a Dask scheduler, for instance tcp://node1:8786 (default:"
        " in processes on this machine)",
    )


@contextmanager
def workers_of(args: argparse.Namespace) -> "Iterator[Workers]":
    """Gives the workers that --workers and --scheduler ask for."""
    from lic_drake.experience.workers import DaskWorkers, LocalWorkers

    if args.scheduler is None:
        with LocalWorkers(args.workers) as local:
            yield local
        return
    with DaskWorkers(args.scheduler, args.workers) as cluster:
        if cluster.capacity() == 0:
            print(
                "lic: the scheduler has no workers yet, waiting for some; start them with:"
                f" dask worker {args.scheduler} --nworkers -1 --nthreads 1",
                file=sys.stderr,
            )
        yield cluster


def add_json_argument(parser: argparse.ArgumentParser) -> None:
    """Adds --json, for output that a machine reads."""
    parser.add_argument("--json", action="store_true", help="print one JSON object (default: text)")
