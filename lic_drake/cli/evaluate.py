"""`lic evaluate`: compares strategies on unseen environments; `lic bench`: measures speed."""

import argparse
from pathlib import Path

from lic_drake.cli.arguments import (
    DEFAULT_SCENARIO,
    Subparsers,
    add_command,
    add_count,
    print_result,
    workers_of,
)
from lic_drake.errors import remark


def add_parser(subparsers: Subparsers) -> None:
    """Adds both subcommands to the command line."""
    parser = add_command(
        subparsers,
        "evaluate",
        run,
        "compare selection strategies on unseen environments",
        "Runs every strategy on the same random goals and prints success rates with 90 % Wilson"
        " intervals and McNemar's paired test against RND. A second attempt finds the environment"
        " as the first left it. Writes trials.parquet, one row per attempt, and the reaches. Run"
        " again, it resumes.",
        "lic evaluate out/evaluation --environments 50 --methods rnd gp",
        ["--stream", "--scenario", "--set", "--library", "--workers", "--scheduler", "--json"],
    )
    parser.add_argument("results", metavar="FOLDER", type=Path, help="folder of the results")
    parser.add_argument(
        "--methods",
        nargs="+",
        default=["rnd", "cost", "gp", "knn"],
        metavar="NAME",
        help="rnd, cost, gp, knn, imagine; gp1 uses LIC-1 for all attempts, gp>cost LIC-1 for the"
        " first and COST for later ones (default: rnd cost gp knn)",
    )
    add_count(parser, "--environments", 200, "number of environments")
    add_count(parser, "--goals", 1, "goals per environment")
    add_count(parser, "--attempts", 2, "maximum number of attempts at a goal")
    parser.add_argument(
        "--still",
        action="store_true",
        help="keep base and torso or pedestal fixed (default: they move along the board)",
    )
    parser.add_argument(
        "--cameras",
        default="",
        metavar="NAME",
        help="cameras that detect apertures and goal, shipped or a .yaml file, e.g. foliage"
        " (default: both are known)",
    )
    parser.add_argument(
        "--variant",
        default="",
        metavar="NAME",
        help="label that keeps these trials apart from others in the folder (default: those of"
        " still and cameras that are given)",
    )
    bench = add_command(
        subparsers,
        "bench",
        run_bench,
        "measure the speed of reaches on this machine",
        "Prints wall time per simulated second and per reach, and its parts.",
        "lic bench reach --reaches 50 --json",
        ["--scenario", "--set", "--json"],
    )
    bench.add_argument("what", choices=["reach"], help="what to measure")
    add_count(bench, "--reaches", 50, "number of reaches")


def run(args: argparse.Namespace) -> int:
    """Evaluates and prints the table of success rates."""
    from lic_drake.evaluate.table import format_rates, summarize_trials
    from lic_drake.evaluate.trial import Evaluation, run_evaluation
    from lic_drake.evaluate.trials import TrialTable
    from lic_drake.paths import shipped_library

    given = (name for name in ("still", "cameras") if getattr(args, name))
    variant = args.variant or "-".join(given)
    evaluation = Evaluation(
        experience=args.library or shipped_library(DEFAULT_SCENARIO),
        results=args.results,
        methods=tuple(args.methods),
        environments=args.environments,
        goals=args.goals,
        attempts=args.attempts,
        stream=args.stream or "evaluation",
        variant=variant,
        overrides=args.set,
        moves=not args.still,
        scenario_name=args.scenario,
        cameras=args.cameras,
    )
    with workers_of(args) as workers:
        rows = run_evaluation(evaluation, workers, say=remark)
    rates = summarize_trials(TrialTable(rows), args.attempts, variant)
    values = {"trials": str(evaluation.trials_path), "rates": rates}
    print_result(args, values, format_rates(rates).rstrip("\n"))
    return 0


def run_bench(args: argparse.Namespace) -> int:
    """Measures and prints the speed of reaches."""
    from lic_drake.evaluate.speed import measure_reaches
    from lic_drake.reach.scenario import load_scenario

    speed = measure_reaches(
        load_scenario(args.scenario or DEFAULT_SCENARIO, args.set), args.reaches
    )
    print_result(args, speed)
    return 0
