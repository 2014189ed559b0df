"""`lic collect`: simulates the reaches of an experience library."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli.arguments import (
    DEFAULT_SCENARIO,
    INCOMPLETE,
    Subparsers,
    add_command,
    print_result,
    workers_of,
)
from lic_drake.errors import remark

if TYPE_CHECKING:
    from lic_drake.experience.collect import CollectionRequest
    from lic_drake.experience.runner import Progress

LOG_EVERY_S = 60.0
"""Interval of progress lines in a log, seconds."""


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = add_command(
        subparsers,
        "collect",
        run,
        "simulate the reaches of an experience library",
        "Covers every start and goal of a scenario's grid in random environments, one row per"
        " reach. Run again after an interruption, it resumes; for an existing library, options may"
        " be omitted.",
        "lic collect out/cylinder --environments 20",
        ["--scenario", "--set", "--stream", "--workers", "--scheduler", "--json"],
    )
    parser.add_argument("library", metavar="LIBRARY", type=Path, help="folder of the library")
    for name, text in (
        ("--environments", "total number of environments (default: 20)"),
        ("--first", "index of the first environment (default: 0)"),
        ("--max-goals", "use only N goals of the grid, evenly spaced (default: all)"),
        ("--max-starts", "use only N starts of the grid, evenly spaced (default: all)"),
    ):
        parser.add_argument(name, metavar="N", type=int, help=text)
    parser.add_argument(
        "--share",
        metavar="K/N",
        default="1/1",
        help="simulate only the K-th of N shares of the environments, e.g. in a job array (default:"
        " %(default)s)",
    )


def run(args: argparse.Namespace) -> int:
    """Collects; returns 0 if the library is complete, 1 if environments failed."""
    from lic_drake.experience.collect import collect
    from lic_drake.experience.store import ExperienceLibrary

    request, share = _make_request(args), args.share
    environments = len(request.environments_of(share))
    remark(
        f"{request.scenario.category}: {environments} environments x {len(request.goals())} goals x"
        f" {len(request.starts())} starts, {request.num_reaches(share)} reaches into {args.library}"
    )
    with workers_of(args) as workers, progress_display() as show:
        progress = collect(
            ExperienceLibrary(args.library), request, workers, share=share, progress=show
        )
    return _conclude(progress, args)


def _make_request(args: argparse.Namespace) -> "CollectionRequest":
    """Returns the request of the options; an existing library supplies what they leave open."""
    from lic_drake.experience.collect import REQUEST_FILE, CollectionRequest, read_request
    from lic_drake.reach.scenario import load_scenario

    path = args.library / REQUEST_FILE
    stored = vars(read_request(path)) if path.exists() else {}
    given = {
        "stream": args.stream,
        "first_environment": args.first,
        "environments": args.environments,
        "max_goals": args.max_goals,
        "max_starts": args.max_starts,
    }
    if not stored or args.scenario or args.set:
        given["scenario"] = load_scenario(args.scenario or DEFAULT_SCENARIO, args.set)
    return CollectionRequest(**(stored | {k: v for k, v in given.items() if v is not None}))


def _conclude(progress: "Progress", args: argparse.Namespace) -> int:
    """Prints the result and returns the exit code."""
    from lic_drake.intervals import wilson_interval

    low, high = wilson_interval(progress.successes, progress.done)
    new = progress.done - progress.present
    values = {
        **asdict(progress),
        "library": str(args.library),
        "new": new,
        "success_interval": [low, high] if progress.done else None,
    }
    print_result(
        args,
        values,
        f"{progress.done} of {progress.total} reaches ({new} new in"
        f" {progress.elapsed_s / 60.0:.1f} min), {progress.successes} successes (90 % interval of"
        f" the rate {low:.1%} to {high:.1%})",
    )
    for name, reason in progress.failed.items():
        remark(f"lic: environment {name} failed: {reason}")
    if progress.done < progress.total:
        remark("lic: the library is incomplete; run the same command to retry")
        return INCOMPLETE
    return 0


@contextmanager
def progress_display() -> "Iterator[Callable[[Progress], None]]":
    """Provides a function that shows progress: a bar on a terminal, else a line a minute."""
    from tqdm import tqdm

    next_line_s = LOG_EVERY_S
    # None: disabled where the standard error is not a terminal.
    with tqdm(disable=None, bar_format="{percentage:3.0f}%|{bar}{postfix}") as bar:

        def show(progress: "Progress") -> None:
            nonlocal next_line_s
            if not bar.disable:
                bar.total, bar.n = progress.total, progress.done
                bar.set_postfix_str(progress.describe())
            elif progress.elapsed_s >= next_line_s:
                remark(progress.describe())
                next_line_s = progress.elapsed_s + LOG_EVERY_S

        yield show
