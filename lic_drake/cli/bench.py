"""`lic bench`: measures speed on this machine."""

import argparse
import json

from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_scenario_arguments,
    positive_int,
)


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the speed of reaches on this machine",
        description="Measures wall seconds per simulated second and per reach, in one process,"
        " split into physics, tactile sensor, MPC and the rest.",
        epilog="example: lic bench reach --reaches 50 --json",
    )
    parser.add_argument("what", choices=["reach"], help="what to measure")
    add_scenario_arguments(parser)
    parser.add_argument(
        "--reaches",
        type=positive_int,
        default=50,
        metavar="N",
        help="number of reaches to measure (default: %(default)s)",
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    from lic_drake.evaluate.speed import measure_reaches
    from lic_drake.reach.scenario import load_scenario

    speed = measure_reaches(load_scenario(args.scenario, args.set), args.reaches)
    if args.json:
        print(json.dumps(speed))
        return 0
    print(
        "{robot} in {category}: {wall_per_sim_s:.4f} wall seconds per simulated second,"
        " {wall_per_reach_s:.3f} s per reach (medians of {reaches} reaches, {simulated_s:.0f} s"
        " simulated)".format(**speed)
    )
    for name, share in speed["split"].items():
        print(f"  {name:8s} {100 * share:5.1f} %")
    return 0
