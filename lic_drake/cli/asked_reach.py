"""The reach that a command line asks for: in the plane, or of a PR2 through an aperture."""

import argparse

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RequestError
from lic_drake.reach.request import ReachRequest, check_goal
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Start
from lic_drake.starts import BoardStarts, board_starts
from lic_drake.types import Vector


def asked_reach(scenario: Scenario, args: argparse.Namespace) -> ReachRequest:
    """Returns the request of the arguments of `lic reach`.

    Raises:
        RequestError: Goal or start are not possible, or are those of another kind of robot.
    """
    instance = scenario.sample_instance(args.stream, args.environment)
    in_space = not scenario.arm().is_planar
    p_WG = _goal(scenario, in_space, args)
    foreign = ("start_y", "start_phi") if in_space else ("aperture", "base_y", "torso")
    for name in foreign:
        if getattr(args, name) is not None:
            option = "--" + name.replace("_", "-")
            raise RequestError(
                f"{option} is not for the robot of {scenario.category}, {scenario.robot}; see"
                " `lic reach --help`"
            )
    if in_space:
        return _through_an_aperture(scenario, instance, p_WG, args)
    y_m = 0.0 if args.start_y is None else args.start_y
    phi_deg = 60.0 if args.start_phi is None else args.start_phi
    x0 = np.array([scenario.task.start_line.x_m, y_m, np.deg2rad(phi_deg)])
    if not np.all(np.isfinite(x0)):
        raise RequestError(f"a start is two finite numbers, got y {y_m} m, phi {phi_deg} degrees")
    check_goal(scenario, p_WG)
    return ReachRequest(scenario, args.stream, args.environment, p_WG, Start(x0))


def _goal(scenario: Scenario, in_space: bool, args: argparse.Namespace) -> Vector:
    if args.goal is None:
        if scenario.task.goal_area is None or in_space:
            return scenario.sample_goal(args.stream, args.environment)
        return np.array([0.6, 0.0, 0.0])
    size = 3 if in_space else 2
    if len(args.goal) != size:
        raise RequestError(
            f"a goal of {scenario.category} is {size} numbers in metres, got {len(args.goal)}:"
            f" --goal {' '.join(map(str, args.goal))}"
        )
    return np.array([*args.goal, 0.0][:3])


def _through_an_aperture(
    scenario: Scenario, instance: ClutterInstance, p_WG: Vector, args: argparse.Namespace
) -> ReachRequest:
    starts = board_starts(scenario, instance, moves=True)
    y_m = 0.0 if args.base_y is None else args.base_y
    torso = starts.home[2] if args.torso is None else args.torso
    b0 = np.array([0.0, y_m, torso])
    _check_base(starts, b0)
    if args.aperture is None:
        p_WA = starts.p_WA[np.argmin(np.linalg.norm(starts.p_WA[:, 1:] - p_WG[1:], axis=1))]
    else:
        p_WA = starts.nearest_aperture(*args.aperture)
    check_goal(scenario, p_WG - b0)
    found = starts.nearest(p_WA, b0)
    if found is None:
        raise RequestError(
            f"from base y {y_m:g} m, torso {torso:g} m the arm cannot be in the aperture at y"
            f" {p_WA[1]:.3f} m, z {p_WA[2]:.3f} m; choose another --base-y, --torso or --aperture"
        )
    start = Start(found.x0, b0)
    return ReachRequest(scenario, args.stream, args.environment, p_WG, start)


def _check_base(starts: BoardStarts, b0: Vector) -> None:
    for axis, option in ((1, "--base-y"), (2, "--torso")):
        value, low, high = b0[axis], starts.b0_lower[axis], starts.b0_upper[axis]
        if not low <= value <= high:
            raise RequestError(f"{option} must be from {low:g} to {high:g} m, got {value:g}")
