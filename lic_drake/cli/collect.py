"""`lic collect`: simulates the reaches of an experience library."""

import argparse
import math
import multiprocessing
import os
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli import exit_codes
from lic_drake.cli.arguments import Subparsers, positive_int

if TYPE_CHECKING:
    from tqdm import tqdm

    from lic_drake.experience.collect import CollectionReport
    from lic_drake.experience.grid import CollectionRequest
    from lic_drake.experience.progress import Progress

DEFAULT_SCENARIO = "cylinder-clutter"


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
        "--environments", metavar="N", type=int, help="number of environments (default: 20)"
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
    parser.add_argument(
        "--workers",
        metavar="N",
        type=positive_int,
        default=os.cpu_count() or 1,
        help="number of worker processes, 200 MB of memory each (default: CPU count, %(default)s)",
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
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Collects; returns 0 when the library is complete, 1 when environments failed."""
    from tqdm import tqdm

    from lic_drake.experience.collect import collect
    from lic_drake.experience.store import ExperienceLibrary

    request = _make_request(args)
    goals, starts = len(request.goals()), len(request.starts())
    print(
        f"{request.scenario.category}: {request.environments} environments x {goals} goals x"
        f" {starts} starts = {request.environments * goals * starts} reaches into {args.library}",
        flush=True,
    )
    # Off when the output is no terminal, so that logs stay short.
    bar = tqdm(disable=None, bar_format="{percentage:3.0f}%|{bar}| {n_fmt}/{total_fmt}{postfix}")
    try:
        with bar:
            report = collect(
                ExperienceLibrary(args.library),
                request,
                workers=args.workers,
                progress=lambda progress: _show(bar, progress),
            )
    except KeyboardInterrupt:
        # A second Ctrl-C does not wait for the running reaches.
        for process in multiprocessing.active_children():
            process.kill()
        print(
            "lic: stopped; finished reaches are kept, go on with:"
            f" lic collect {shlex.quote(str(args.library))}",
            file=sys.stderr,
        )
        return exit_codes.INTERRUPTED
    return _conclude(report)


def _make_request(args: argparse.Namespace) -> "CollectionRequest":
    """Returns what the options ask for; what they leave open is as the library has it."""
    from lic_drake.experience.grid import REQUEST_FILE, CollectionRequest, read_request
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


def _show(bar: "tqdm[None]", progress: "Progress") -> None:
    """Moves the progress bar."""
    bar.total, bar.n = progress.total, progress.done
    left = progress.time_left_s
    clock = "?" if left is None else f"{int(left) // 3600}:{int(left) // 60 % 60:02d} h"
    bar.set_postfix_str(
        f"{progress.successes} successes, {progress.reaches_per_minute:.0f} reaches/min,"
        f" {clock} left"
    )


def _conclude(report: "CollectionReport") -> int:
    """Prints the result and returns the exit code."""
    from lic_drake.intervals import wilson_interval

    progress = report.progress
    low, high = wilson_interval(progress.successes, progress.done)
    rate = progress.successes / progress.done if progress.done else math.nan
    print(
        f"{progress.done} of {progress.total} reaches"
        f" ({progress.done - progress.present} new in {progress.elapsed_s / 60.0:.1f} min);"
        f" {progress.successes} successes: {rate:.1%}"
        f" (90 % interval {low:.1%} to {high:.1%})"
    )
    for failed in report.failed:
        print(f"lic: environment {failed.environment} failed: {failed.reason}", file=sys.stderr)
    if progress.done < progress.total:
        print("lic: the library is incomplete; run the same command to try again", file=sys.stderr)
        return exit_codes.INCOMPLETE
    return 0
