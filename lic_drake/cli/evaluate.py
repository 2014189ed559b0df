"""`lic evaluate`: compares strategies on unseen environments."""

import argparse
import json
import sys
from pathlib import Path

from lic_drake.cli import exit_codes
from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_library_argument,
    add_workers_arguments,
    positive_int,
    workers_of,
)


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "evaluate",
        help="compare selection strategies on unseen environments",
        description="Runs every strategy on the same random goals in the same environments, none"
        " of them in a library, and prints success rates with Wilson 90 % intervals and"
        " McNemar's paired test against RND. A second attempt finds the environment as the first"
        " one left it. Writes trials.parquet, a row for each attempt, and their reaches. Run"
        " again, it goes on where it was.",
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
        help="strategies to compare: rnd, cost, gp, knn; gp1 uses LIC-1 for all attempts, gp>cost"
        " LIC-1 for the first one and COST for later ones (default: rnd cost gp knn)",
    )
    for name, default, text in (
        ("--environments", 200, "number of environments"),
        ("--goals", 1, "goals in each"),
        ("--attempts", 2, "attempts at a goal at the most"),
    ):
        parser.add_argument(
            name,
            type=positive_int,
            default=default,
            metavar="N",
            help=f"{text} (default: %(default)s)",
        )
    parser.add_argument(
        "--stream",
        default="evaluation",
        metavar="NAME",
        help="seed stream of environments and goals: training, evaluation, calibration or holdout"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--common-goals",
        action="store_true",
        help="the same goals in all environments (default: others in each)",
    )
    parser.add_argument(
        "--second-attempts",
        type=Path,
        metavar="FOLDER",
        help="library of real second attempts that LIC-2 learns from (default: pairs of single"
        " reaches, as in the paper)",
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="let later attempts find the environment as it was drawn (default: as the attempt"
        " before left it)",
    )
    parser.add_argument(
        "--set",
        default="",
        metavar="YAML",
        help="values put over the scenario that is tried, for instance"
        ' "{clutter: {num_blocked: 10}}" (default: none)',
    )
    parser.add_argument(
        "--scenario",
        default="",
        metavar="NAME",
        help="scenario that is tried, shipped or a .yaml file, with what was learned in the"
        " library's (default: the library's)",
    )
    parser.add_argument(
        "--cameras",
        default="",
        metavar="NAME",
        help="cameras that have to find apertures and goal, shipped or a .yaml file, for instance"
        " foliage (default: both are known)",
    )
    parser.add_argument(
        "--still",
        action="store_true",
        help="keep base and torso of a PR2 where they are (default: they move along the board)",
    )
    parser.add_argument(
        "--variant",
        default="",
        metavar="NAME",
        help="name of these trials beside others in the same folder (default: none)",
    )
    add_workers_arguments(parser)
    add_library_argument(parser)
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.evaluate.table import format_rates, summarize_trials
    from lic_drake.evaluate.trial import Evaluation, run_evaluation
    from lic_drake.evaluate.trials import TrialTable
    from lic_drake.paths import shipped_library

    evaluation = Evaluation(
        experience=args.library or shipped_library("cylinder-clutter"),
        results=args.results,
        methods=tuple(args.methods),
        environments=args.environments,
        goals=args.goals,
        attempts=args.attempts,
        stream=args.stream,
        common_goals=args.common_goals,
        second_attempts=args.second_attempts,
        fresh=args.fresh,
        variant=args.variant,
        overrides=args.set,
        moves=not args.still,
        scenario_name=args.scenario,
        cameras=args.cameras,
    )
    remarks = sys.stderr if args.json else sys.stdout
    try:
        with workers_of(args) as workers:
            rows = run_evaluation(
                evaluation, workers, say=lambda line: print(line, file=remarks, flush=True)
            )
    except KeyboardInterrupt:
        print(
            "lic: stopped; reaches of finished environments are kept, run the same command to go"
            " on",
            file=sys.stderr,
        )
        return exit_codes.INTERRUPTED
    rates = summarize_trials(TrialTable(rows), args.attempts, args.variant)
    if args.json:
        print(json.dumps({"trials": str(evaluation.trials_path), "rates": rates}))
    else:
        print(format_rates(rates), end="")
    return 0
