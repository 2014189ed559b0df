"""`lic evaluate`: compares strategies on unseen environments."""

import argparse
import os
from pathlib import Path

from lic_drake.cli.arguments import Subparsers, add_library_argument, positive_int


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "evaluate",
        help="compare selection strategies on unseen environments",
        description="Runs every strategy on the same random goals in the same environments, none"
        " of them in a library, and prints success rates with Wilson 90 % intervals and"
        " McNemar's paired test against RND. Run again, it goes on where it was.",
        epilog="example: lic evaluate out/evaluation --environments 50 --methods rnd gp",
    )
    parser.add_argument(
        "results", metavar="FOLDER", type=Path, help="where the evaluation's reaches are kept"
    )
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["rnd", "cost", "gp", "knn"],
        metavar="NAME",
        help="strategies to compare (default: rnd cost gp knn)",
    )
    for name, default, text in (
        ("--environments", 200, "number of environments"),
        ("--goals", 1, "goals in each"),
        ("--attempts", 1, "attempts at a goal at the most"),
        ("--workers", os.cpu_count() or 1, "number of processes; the default is one a core"),
    ):
        parser.add_argument(
            name,
            type=positive_int,
            default=default,
            metavar="N",
            help=f"{text} (default: %(default)s)",
        )
    add_library_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.evaluate.experiment import format_rates, run_trials, summarize_trials
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library

    library = ExperienceLibrary(args.library or shipped_library("cylinder-clutter"))
    trials = run_trials(
        library.scenario(),
        library,
        args.results,
        args.methods,
        args.environments,
        args.goals,
        args.attempts,
        args.workers,
    )
    print(format_rates(summarize_trials(trials, args.attempts)), end="")
    return 0
