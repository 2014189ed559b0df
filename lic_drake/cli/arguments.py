"""What subcommands share: how they are declared, common options, exit codes, output."""

import argparse
import gc
import json
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import yaml

from lic_drake.config import merge, read_mapping
from lic_drake.errors import remark
from lic_drake.paths import find_library

if TYPE_CHECKING:
    from lic_drake.experience.workers import Workers

type Subparsers = "argparse._SubParsersAction[argparse.ArgumentParser]"
"""The object that subcommands add their parsers to."""

INCOMPLETE, USER_ERROR, INTERRUPTED, BROKEN_PIPE = 1, 2, 130, 141
"""Exit codes: the result is incomplete or differs; invalid input; Ctrl-C; output closed."""

DEFAULT_SCENARIO = "cylinder-clutter"
"""Scenario, and library, of commands that are given none."""


def whole_number(least: int) -> Callable[[str], int]:
    """Returns a reader of whole numbers with a minimum, for `type=`."""

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() else -1
        if value < least:
            limit = f"{least} or more"
            raise argparse.ArgumentTypeError(f"needs a whole number of {limit}, got {text!r}")
        return value

    return read


CATEGORIES = (
    *("cylinder-clutter", "passage-clutter", "cylinder-aperture-clutter"),
    *("sphere-aperture-clutter", "foliage-aperture-clutter"),
)
"""Clutter categories that are shipped: three in the plane, two in space."""

_SHARED: dict[str, dict[str, Any]] = {
    "--scenario": {
        "metavar": "NAME|FILE",
        "default": "",
        "help": "shipped scenario or path of a .yaml file (default: the library's, else"
        f" {DEFAULT_SCENARIO})",
    },
    "--set": {
        "metavar": "YAML",
        "default": "",
        "help": 'scenario values to override, in SI units, e.g. "{stop: {timeout_s: 20}}"'
        " (default: none)",
    },
    "--robot": {
        "metavar": "NAME|FILE",
        "default": "",
        "help": "robot, or path of its .yaml file (default: that of the category)",
    },
    "--category": {
        "choices": CATEGORIES,
        "help": f"clutter category (default: {CATEGORIES[0]}, for an arm in space {CATEGORIES[3]})",
    },
    "--stream": {
        "metavar": "NAME",
        "help": "seed stream of the environments: training, evaluation, calibration or holdout"
        " (default: the library's, else training, for lic collect; otherwise evaluation)",
    },
    "--goal": {
        "metavar": "METRES",
        "type": float,
        "nargs": "+",
        "help": "goal in metres, X Y in the plane, X Y Z in space; x points into the clutter"
        " (default: none for lic select, which needs it; else the environment's, or 0.6 0)",
    },
    "--method": {
        "metavar": "NAME",
        "default": "gp",
        "help": "selection strategy: rnd, cost, knn, gp, or imagine: gp, then starts tried in"
        " imagined clutter (default: %(default)s)",
    },
    "--library": {
        "metavar": "NAME|FOLDER",
        "type": find_library,
        "help": "experience library: a folder, that of a training, or the name of a shipped one"
        f" (default: the shipped one of the category, {DEFAULT_SCENARIO} where none is named)",
    },
    "--seed": {
        "metavar": "N",
        "type": whole_number(0),
        "default": 0,
        "help": "environment, and seed of random choices (default: %(default)s)",
    },
    "--workers": {
        "metavar": "N",
        "type": whole_number(1),
        "help": "number of environments simulated in parallel, 200 MB of memory each (default: CPU"
        " count, or all workers of the scheduler)",
    },
    "--scheduler": {
        "metavar": "ADDRESS",
        "help": "Dask scheduler to simulate on, e.g. tcp://node1:8786 (default: local processes)",
    },
    "--json": {"action": "store_true", "help": "print a JSON object (default: text)"},
}


def add_command(
    subparsers: Subparsers,
    name: str,
    run: Callable[[argparse.Namespace], int],
    help: str,
    more: str,
    example: str,
    options: Sequence[str] = (),
) -> argparse.ArgumentParser:
    """Adds a subcommand, run by `run`, which returns the exit code, with some shared options."""
    parser = subparsers.add_parser(
        name,
        help=help,
        description=f"{help[0].upper()}{help[1:]}. {more}".strip(),
        epilog=f"example: {example}",
    )
    for option in options:
        parser.add_argument(option, **_SHARED[option])
    parser.set_defaults(run=run, parser=parser)
    return parser


def add_count(
    parser: argparse.ArgumentParser, name: str, default: int, help: str, least: int = 1
) -> None:
    """Adds an option that takes a whole number with a minimum."""
    help = f"{help} (default: %(default)s)"
    parser.add_argument(name, metavar="N", type=whole_number(least), default=default, help=help)


class _Postponed(ModuleType):
    """Stands for a module until something in it is asked for."""

    def __getattr__(self, name: str) -> object:
        if sys.modules[self.__name__] is self:
            del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


@contextmanager
def quick_imports() -> Iterator[None]:
    """Spares imports what takes a second and is not needed.

    The garbage collector need not go through what they make, and scikit-learn imports scipy.stats
    for functions that no estimator of this package calls. `importlib.util.LazyLoader` would do, but
    for Python 3.12.0 to 3.12.2, where a second import statement loads the module.
    """
    sys.modules.setdefault("scipy.stats", _Postponed("scipy.stats"))
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()  # Most of it stays.
        gc.enable()


def category_of(robot: str) -> str:
    """Returns the category that --category means by default, for a --robot or none."""
    if not robot:
        return CATEGORIES[0]
    from lic_drake.robots.registry import get_robot

    return CATEGORIES[0 if get_robot(robot).is_planar else 3]


def overrides_of(given: str, category: str) -> str:
    """Returns the YAML text of --set; before spheres some apertures are closed unless it says so.

    With all of them open the best start is too often the one that is straight before the goal.
    """
    closed = {"clutter": {"num_blocked": 8}} if category == CATEGORIES[3] else {}
    return yaml.safe_dump(merge(closed, read_mapping(given, "--set"))) if closed else given


def with_robot(overrides: str, robot: str) -> str:
    """Returns the YAML text of --set with a robot added, unless that is empty."""
    values = read_mapping(overrides, "--set")
    return yaml.safe_dump(values | {"robot": robot}) if robot else overrides


@contextmanager
def workers_of(args: argparse.Namespace) -> "Iterator[Workers]":
    """Provides the workers for --workers and --scheduler."""
    from lic_drake.experience.workers import DaskWorkers, LocalWorkers

    if args.scheduler is None:
        with LocalWorkers(args.workers) as local:
            yield local
        return
    with DaskWorkers(args.scheduler, args.workers) as cluster:
        if cluster.capacity() == 0:
            remark(
                "lic: the scheduler has no workers yet, waiting for some; start them with:"
                f" dask worker {args.scheduler} --nworkers -1 --nthreads 1"
            )
        yield cluster


def print_result(
    args: argparse.Namespace, values: Mapping[str, Any], text: str | None = None
) -> None:
    """Prints values as JSON, or as a text that by default has a line for each of them."""
    width = max(map(len, values))
    lines = (f"{name:{width}}  {_shown(value)}" for name, value in values.items())
    print(json.dumps(values) if args.json else text or "\n".join(lines))


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} {_shown(item)}" for name, item in value.items()) or "none"
    if isinstance(value, list | tuple):
        first = ", ".join(map(_shown, value[:10])) or "none"
        return f"{first}, ..." if len(value) > 10 else first
    return f"{value:.4g}" if isinstance(value, float) else str(value)
