"""Goals, starts and failed attempts that `lic reach` and `lic select` are given; needs Drake."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lic_drake.config import read_mapping
from lic_drake.errors import RequestError
from lic_drake.reach.request import ReachRecord, ReachRequest, check_goal
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Start
from lic_drake.select.situation import FailedReach
from lic_drake.starts import BoardStarts, FeasibleStarts, board_starts
from lic_drake.types import Vector


def read_goal(scenario: Scenario, numbers: Sequence[float]) -> Vector:
    """Returns the goal given by --goal, shape (3,), metres."""
    size = 2 if scenario.arm().is_planar else 3
    if len(numbers) != size:
        raise RequestError(
            f"a goal of {scenario.category} is {size} numbers in metres, got {len(numbers)}:"
            f" --goal {' '.join(map(str, numbers))}"
        )
    return np.array([*numbers, 0.0][:3])


def make_request(scenario: Scenario, args: argparse.Namespace) -> ReachRequest:
    """Returns the request of the arguments of `lic reach`."""
    planar = scenario.arm().is_planar
    for name in ("base_y", "torso", "aperture") if planar else ("start_y", "start_phi"):
        if getattr(args, name) is not None:
            raise RequestError(
                f"--{name.replace('_', '-')} is not for the robot of {scenario.category},"
                f" {scenario.robot}; see `lic reach --help`"
            )
    if args.goal is not None:
        p_WG = read_goal(scenario, args.goal)
    elif planar and scenario.task.goal_area is not None:
        p_WG = np.array([0.6, 0.0, 0.0])
    else:
        p_WG = scenario.sample_goal(args.stream, args.environment)
    if planar:
        y_m = 0.0 if args.start_y is None else args.start_y
        phi = np.deg2rad(60.0 if args.start_phi is None else args.start_phi)
        start = Start(np.array([scenario.task.start_line.x_m, y_m, phi]))
    else:
        start = _start_in_aperture(scenario, p_WG, args)
    check_goal(scenario, p_WG - start.b0)
    return ReachRequest(scenario, args.stream, args.environment, p_WG, start)


def _start_in_aperture(scenario: Scenario, p_WG: Vector, args: argparse.Namespace) -> Start:
    instance = scenario.sample_instance(args.stream, args.environment)
    starts = board_starts(scenario, instance, moves=True)
    y_m = 0.0 if args.base_y is None else args.base_y
    torso = starts.home[2] if args.torso is None else args.torso
    b0 = np.array([0.0, y_m, torso])
    for axis, option in ((1, "--base-y"), (2, "--torso")):
        low, high = starts.b0_lower[axis], starts.b0_upper[axis]
        if not low <= b0[axis] <= high:
            raise RequestError(f"{option} must be from {low:g} to {high:g} m, got {b0[axis]:g}")
    if args.aperture is None:
        p_WA = starts.p_WA[np.argmin(np.linalg.norm(starts.p_WA[:, 1:] - p_WG[1:], axis=1))]
    else:
        p_WA = starts.nearest_aperture(*args.aperture)
    found = starts.nearest(p_WA, b0)
    if found is None:
        raise RequestError(
            f"from base y {y_m:g} m, torso {torso:g} m the arm cannot be in the aperture at y"
            f" {p_WA[1]:.3f} m, z {p_WA[2]:.3f} m; choose another --base-y, --torso or --aperture"
        )
    return Start(found.x0, b0)


def read_failure(scenario: Scenario, starts: FeasibleStarts, text: str) -> FailedReach:
    """Reads a failed attempt from YAML or JSON, given in place or as a file."""
    if not text.lstrip().startswith("{"):
        try:
            text = Path(text).read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise RequestError(f"--failed: cannot read {text!r}: {error}") from None
    values = read_mapping(text, "--failed")
    shown = {}
    for name, value in values.items():
        column = ReachRecord.__dataclass_fields__.get(name)
        if column is None:
            raise RequestError(f"--failed: {name!r} is not a column of a record, such as start_y")
        if column.type not in (int, float) or value is None:  # What was never measured is null.
            continue
        limit = np.pi if name in ("start_phi", "final_phi") else 1e6
        if type(value) not in (int, float) or not abs(value) <= limit:
            raise RequestError(
                f"--failed: {name} must be a number from {-limit:.5g} to {limit:.5g}, in metres,"
                f" radians or m/s, got {value!r}"
            )
        shown[name] = float(value)
    if values.get("category", scenario.category) != scenario.category:
        raise RequestError(
            f"--failed is a reach of {values['category']}, but the library is of"
            f" {scenario.category}; choose another --library"
        )
    axes = ("base_x", "base_y", "torso")
    varied = np.ptp(starts.grid.b0, axis=0) > 0.0
    needed = ["start_y", "start_z" if isinstance(starts, BoardStarts) else "start_phi"]
    require(shown, [*needed, *(name for name, v in zip(axes, varied, strict=True) if v)])
    b0 = np.array([shown.get(a, x) for a, x in zip(axes, starts.grid.b0[0], strict=True)])
    if isinstance(starts, BoardStarts):
        p_WA = starts.nearest_aperture(shown["start_y"], shown["start_z"])
        start = starts.nearest(p_WA, b0) or Start(np.append(p_WA, [1.0, 0.0, 0.0, 0.0]), b0)
    else:
        x_m = shown.get("start_x", float(starts.grid.x0[0, 0]))
        start = Start(np.array([x_m, shown["start_y"], shown["start_phi"]]), b0)
    return FailedReach(start=start, shown={**FailedReach.from_start(start).shown, **shown})


def require(shown: Mapping[str, float], needed: Sequence[str], hint: str = "") -> None:
    """Refuses a failed attempt that lacks a needed value."""
    missing = [name for name in needed if name not in shown]
    if missing:
        raise RequestError(
            f"a failed attempt needs {', '.join(needed)}, but {', '.join(missing)} is missing; add"
            f" it to --failed{hint}"
        )
