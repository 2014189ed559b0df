"""`lic select`: chooses an initial condition without reaching."""

import argparse
import json
from typing import TYPE_CHECKING

from lic_drake.cli.arguments import (
    Subparsers,
    add_json_argument,
    add_library_argument,
    add_method_argument,
    non_negative_int,
)

if TYPE_CHECKING:
    from lic_drake.reach.scenario import Scenario
    from lic_drake.reach.starts import Starts
    from lic_drake.select.situation import FailedReach


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
        nargs="+",
        required=True,
        metavar="METRES",
        help="goal, X Y or for the PR2 X Y Z, in metres (no default: must be given)",
    )
    add_method_argument(parser)
    parser.add_argument(
        "--failed",
        type=float,
        nargs=2,
        action="append",
        default=[],
        metavar=("Y", "DEG"),
        help="start (metres, degrees) of an attempt that failed, for the PR2 the aperture (Y, Z) in"
        " metres; may be given several times (default: none)",
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

    from lic_drake.errors import RequestError
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.paths import shipped_library
    from lic_drake.reach.request import check_goal
    from lic_drake.reach.starts import make_starts
    from lic_drake.select.registry import make_selector, needs_library
    from lic_drake.select.situation import Situation

    needs_library(args.method)
    library = ExperienceLibrary(args.library or shipped_library("cylinder-clutter"))
    scenario = library.scenario()
    instance = scenario.sample_instance("evaluation", args.seed)
    if len(args.goal) != instance.num_axes:
        raise RequestError(
            f"a goal of {scenario.category} is {instance.num_axes} numbers in metres, got"
            f" {len(args.goal)}: --goal {' '.join(map(str, args.goal))}"
        )
    p_WG = np.array([*args.goal, 0.0][:3])
    starts = make_starts(scenario, instance)
    stands = np.unique(starts.grid.b0, axis=0)
    nearest = stands[np.argmin(np.linalg.norm((stands - p_WG)[:, 1:], axis=1))]
    check_goal(scenario, p_WG - nearest)
    failed = tuple(_failed_start(scenario, starts, *numbers) for numbers in args.failed)
    situation = Situation(p_WG=p_WG, starts=starts, failed=failed)
    rng = np.random.default_rng(args.seed)
    selector = make_selector(args.method, scenario.arm(), library.columns(), rng, scenario.category)
    chosen = selector.select(situation)
    x0, b0, q = chosen.start.x0, chosen.start.b0, chosen.start.q
    assert q is not None
    if args.json:
        print(
            json.dumps(
                {
                    "method": chosen.method,
                    "start": x0.tolist(),
                    "base": b0[:2].tolist(),
                    "torso": float(b0[2]),
                    "joint_angles": q.tolist(),
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
    base = "" if not np.any(starts.grid.b0[:, :2]) else f", base at y {b0[1]:+.3f} m"
    if instance.num_axes == 2:
        where = f"start at y {x0[1]:+.3f} m, phi {np.rad2deg(x0[2]):+.1f} degrees"
    else:
        where = (
            f"start in the aperture at y {x0[1]:+.3f} m, z {x0[2]:.3f} m, torso at {b0[2]:.3f} m"
        )
    print(
        f"{chosen.method}: {where}{base}{estimate}; joint angles"
        f" {np.round(np.rad2deg(q), 1).tolist()} degrees; {chosen.seconds:.2f} s"
    )
    return 0


def _failed_start(scenario: "Scenario", starts: "Starts", y: float, other: float) -> "FailedReach":
    """Returns a failure that began at y and an angle in degrees, or in the aperture at (y, z).

    Raises:
        RequestError: There is no aperture.
    """
    import numpy as np

    from lic_drake.reach.pointing_starts import PointingStarts
    from lic_drake.reach.start import Start
    from lic_drake.select.situation import FailedReach

    if not isinstance(starts, PointingStarts):
        x0 = np.array([scenario.task.start_line.x_m, y, np.deg2rad(other)])
        return FailedReach.from_start(Start(x0))
    x0 = np.array([*starts.nearest_aperture(y, other), 1.0, 0.0, 0.0, 0.0])
    b0 = np.array([0.0, 0.0, scenario.task.torso_m])
    return FailedReach.from_start(Start(x0, b0))
