"""`lic select`: chooses an initial condition without reaching."""

import argparse
import json

from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_library_argument,
    add_method_argument,
    non_negative_int,
)


def add_parser(subparsers: Subparsers) -> None:
    """Adds the subcommand to the command line."""
    parser = subparsers.add_parser(
        "select",
        help="choose the start pose of a reach",
        description="Chooses the start pose for a goal from an experience library and prints it"
        " with its estimated probability of success.",
        epilog="example: lic select --goal 0.6 0.1 --method gp",
    )
    parser.add_argument(
        "--goal",
        type=float,
        nargs=2,
        required=True,
        metavar=("X", "Y"),
        help="goal in metres (no default: must be given)",
    )
    add_method_argument(parser)
    parser.add_argument(
        "--failed",
        type=float,
        nargs=2,
        action="append",
        default=[],
        metavar=("Y", "DEG"),
        help="start (metres, degrees) of an attempt that failed; may be given several times"
        " (default: none)",
    )
    add_library_argument(parser)
    parser.add_argument(
        "--seed", type=non_negative_int, default=0, metavar="N", help="for rnd (default: 0)"
    )
    add_json_argument(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Runs the subcommand and returns the exit code."""
    import numpy as np

    from lic_drake.evaluate.trial import planar_arm_of
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library
    from lic_drake.reach.request import check_goal
    from lic_drake.reach.starts import make_starts
    from lic_drake.select.registry import make_selector, needs_library
    from lic_drake.select.situation import FailedReach, Situation

    needs_library(args.method)
    library = ExperienceLibrary(args.library or shipped_library("cylinder-clutter"))
    scenario = library.scenario()
    p_WG = np.array([*args.goal, 0.0])
    arm = planar_arm_of(scenario)
    starts = make_starts(scenario, scenario.sample_instance("evaluation", args.seed))
    bases = starts.grid.p_WR
    nearest = bases[np.argmin(np.linalg.norm(bases - p_WG[:2], axis=1))]
    check_goal(scenario, p_WG - [*nearest, 0.0])
    failed = tuple(
        FailedReach.from_start(np.array([scenario.task.start_line.x_m, y, np.deg2rad(phi)]))
        for y, phi in args.failed
    )
    situation = Situation(p_WG=p_WG, starts=starts, failed=failed)
    rng = np.random.default_rng(args.seed)
    selector = make_selector(args.method, arm, library.columns(), rng, scenario.category)
    chosen = selector.select(situation)
    if args.json:
        print(
            json.dumps(
                {
                    "method": chosen.method,
                    "start": chosen.x0.tolist(),
                    "base": chosen.p_WR.tolist(),
                    "joint_angles": chosen.q.tolist(),
                    "estimated_success": chosen.probability,
                    "seconds": chosen.seconds,
                }
            )
        )
        return 0
    estimate = (
        ""
        if chosen.probability is None
        else f", estimated success {100 * chosen.probability:.1f} %"
    )
    base = "" if scenario.task.base is None else f", base at y {chosen.p_WR[1]:+.3f} m"
    print(
        f"{chosen.method}: start at y {chosen.x0[1]:+.3f} m, phi"
        f" {np.rad2deg(chosen.x0[2]):+.1f} degrees{base}{estimate}; joint angles"
        f" {np.round(np.rad2deg(chosen.q), 1).tolist()} degrees; {chosen.seconds:.2f} s"
    )
    return 0
