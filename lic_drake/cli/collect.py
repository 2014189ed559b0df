"""`lic collect`: simulates the reaches of an experience library."""

import argparse
import json
import math
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Self, TextIO

from lic_drake.cli import exit_codes
from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_workers_arguments,
    workers_of,
)

if TYPE_CHECKING:
    from lic_drake.experience.collect import CollectionRequest
    from lic_drake.experience.runner import Progress

DEFAULT_SCENARIO = "cylinder-clutter"
"""Scenario of a new library when none is asked for."""

LOG_EVERY_S = 60.0
"""Time between two lines in a log, seconds."""


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "collect",
        help="simulate the reaches of an experience library",
        description="Simulates every start and goal of a scenario's grid in a number of random"
        " environments and keeps one row per reach. Interrupted or run again, it goes on where it"
        " was; an existing library needs no options.",
        epilog="example: lic collect out/cylinder --environments 20",
    )
    parser.add_argument("library", metavar="LIBRARY", type=Path, help="folder of the library")
    parser.add_argument(
        "--scenario",
        metavar="NAME|FILE",
        help=f"shipped scenario or path of a .yaml file (default: {DEFAULT_SCENARIO})",
    )
    parser.add_argument(
        "--set",
        metavar="YAML",
        help='values put over the scenario in SI units, for instance "{stop: {timeout_s: 20}}"'
        " (default: none)",
    )
    parser.add_argument(
        "--environments",
        metavar="N",
        type=int,
        help="number of environments of the whole library (default: 20)",
    )
    parser.add_argument(
        "--first", metavar="N", type=int, help="index of the first environment (default: 0)"
    )
    parser.add_argument(
        "--stream",
        metavar="NAME",
        help="seed stream of the environments: training, evaluation, calibration or holdout"
        " (default: training)",
    )
    add_workers_arguments(parser)
    parser.add_argument(
        "--share",
        metavar="K/N",
        default="1/1",
        help="simulate only the K-th of N shares of the environments, side by side with the other"
        " shares, for instance in a job array (default: %(default)s)",
    )
    parser.add_argument(
        "--max-goals",
        metavar="N",
        type=int,
        help="use only N goals of the grid, evenly thinned (default: all)",
    )
    parser.add_argument(
        "--max-starts",
        metavar="N",
        type=int,
        help="use only N starts of the grid, evenly thinned (default: all)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Collects; returns 0 when the library is complete, 1 when environments failed."""
    from lic_drake.experience.collect import collect
    from lic_drake.experience.store import ExperienceLibrary

    request, share = _make_request(args), args.share
    environments = len(request.environments_of(share))
    goals, starts, total = len(request.goals()), len(request.starts()), request.num_reaches(share)
    about = "" if total == environments * goals * starts else "about "
    print(
        f"{request.scenario.category}: {environments} environments x {goals} goals x"
        f" {about}{starts} starts = {total} reaches into {args.library}",
        file=_remarks(args),
        flush=True,
    )
    try:
        with workers_of(args) as workers, ProgressDisplay(_remarks(args)) as display:
            progress = collect(
                ExperienceLibrary(args.library),
                request,
                workers,
                share=share,
                progress=display.show,
            )
    except KeyboardInterrupt:
        print(
            f"lic: stopped; finished environments are kept, go on with: {_same_command(args)}",
            file=sys.stderr,
        )
        return exit_codes.INTERRUPTED
    return _conclude(progress, args)


def _remarks(args: argparse.Namespace) -> TextIO:
    """Returns where to print what is no part of the result."""
    return sys.stderr if args.json else sys.stdout


def _same_command(args: argparse.Namespace) -> str:
    """Returns the command that goes on with a library."""
    command = ["lic", "collect", str(args.library)]
    if args.scheduler is not None:
        command += ["--scheduler", args.scheduler]
    if args.share != "1/1":
        command += ["--share", args.share]
    return shlex.join(command)


def _make_request(args: argparse.Namespace) -> "CollectionRequest":
    """Returns what the options ask for; what they leave open is as the library has it."""
    from lic_drake.experience.collect import REQUEST_FILE, CollectionRequest, read_request
    from lic_drake.reach.scenario import load_scenario

    path = args.library / REQUEST_FILE
    stored = read_request(path) if os.path.exists(path) else None
    given = {
        "stream": args.stream,
        "first_environment": args.first,
        "environments": args.environments,
        "max_goals": args.max_goals,
        "max_starts": args.max_starts,
    }
    if stored is None or args.scenario is not None or args.set is not None:
        given["scenario"] = load_scenario(args.scenario or DEFAULT_SCENARIO, args.set or "")
    values = {name: value for name, value in given.items() if value is not None}
    return CollectionRequest(**{**(vars(stored) if stored else {}), **values})


def _conclude(progress: "Progress", args: argparse.Namespace) -> int:
    """Prints the result and returns the exit code."""
    from lic_drake.intervals import wilson_interval

    low, high = wilson_interval(progress.successes, progress.done)
    rate = progress.successes / progress.done if progress.done else math.nan
    if args.json:
        values = {
            "library": str(args.library),
            "total": progress.total,
            "done": progress.done,
            "new": progress.done - progress.present,
            "successes": progress.successes,
            "success_interval": [low, high] if progress.done else None,
            "elapsed_s": progress.elapsed_s,
            "failed": dict(progress.failed),
        }
        print(json.dumps(values))
    else:
        print(
            f"{progress.done} of {progress.total} reaches"
            f" ({progress.done - progress.present} new in {progress.elapsed_s / 60.0:.1f} min);"
            f" {progress.successes} successes: {rate:.1%}"
            f" (90 % interval {low:.1%} to {high:.1%})"
        )
    for name, reason in progress.failed.items():
        print(f"lic: environment {name} failed: {reason}", file=sys.stderr)
    if progress.done < progress.total:
        print("lic: the library is incomplete; run the same command to try again", file=sys.stderr)
        return exit_codes.INCOMPLETE
    return 0


class ProgressDisplay:
    """A context manager; `show` takes the progress as often as there is any.

    Args:
        log: Where lines go when there is no terminal for a bar; by default the standard output.
    """

    def __init__(self, log: TextIO | None = None) -> None:
        from tqdm import tqdm

        # None: off where the output is no terminal.
        self._bar = tqdm(disable=None, bar_format="{percentage:3.0f}%|{bar}{postfix}")
        self._log = log
        self._next_line_s = LOG_EVERY_S

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._bar.close()

    def show(self, progress: "Progress") -> None:
        """Shows how far the collection is."""
        if not self._bar.disable:
            self._bar.total, self._bar.n = progress.total, progress.done
            self._bar.set_postfix_str(progress.describe())
        elif progress.elapsed_s >= self._next_line_s:
            print(progress.describe(), file=self._log or sys.stdout, flush=True)
            self._next_line_s = progress.elapsed_s + LOG_EVERY_S
