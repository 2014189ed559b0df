"""`ReachRequest` and `ReachRecord`: what goes into a reach and what comes out, as plain data."""

import hashlib
import json
from dataclasses import MISSING, dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import IN_PLANE, IN_SPACE, POSE_AXES, Start, Starts
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

SIMULATION = "simulation"
"""Source of the records that lic_drake has simulated."""

OUTCOMES = ("reached", "stuck", "force", "timeout", "diverged", "invalid_start", "unreachable")
"""How a reach can end; the last two before it began, because the arm cannot stand at the start or
the goal is further away than the arm is long."""


@dataclass(frozen=True, eq=False)
class ReachRequest:
    """One reach to simulate. The record is a pure function of it; equal requests have equal keys.

    Attributes:
        stream: Seed stream of the environment, one of `lic_drake.seeds.STREAMS`.
        environment: Index of the environment in its stream.
        goal: p_WG, shape (3,), metres.
        start: Where it begins. Joint angles that are all that the arm can have there are left out.
        after: Starts of reaches to the same goal that went before, in their order, and left the
            environment as it is found; without any it is as it was drawn.

    Raises:
        RequestError: The goal is not finite, or the robot has start poses of another kind.
    """

    scenario: Scenario
    stream: str
    environment: int
    goal: Vector
    start: Start
    after: tuple[Start, ...] = ()

    def __post_init__(self) -> None:
        goal = np.array(self.goal, dtype=float)
        _check_point(goal)
        goal.flags.writeable = False
        object.__setattr__(self, "goal", goal)
        object.__setattr__(self, "start", _checked(self.scenario, self.start))
        object.__setattr__(self, "after", tuple(_checked(self.scenario, x) for x in self.after))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ReachRequest) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @cached_property
    def key(self) -> str:
        """Identifies the request in a library: 16 hexadecimal digits."""
        return self._key(self.scenario.digest)

    def _key(self, digest: str) -> str:
        # Quaternions and joint angles carry noise of 1e-17 that differs between machines: in space
        # nine digits count.
        x0, b0 = _significant(self.start.x0), self.start.b0.tolist()
        content: list[object] = [digest, self.stream, self.environment, self.goal.tolist(), x0]
        # Left out where the base stands at the origin, as in a library of a fixed base.
        if b0[:2] != [0.0, 0.0] or self.after:
            content += [b0[:2], [(_significant(s.x0), s.b0[:2].tolist()) for s in self.after]]
        if len(x0) == IN_SPACE:
            content += [b0[2], [float(s.b0[2]) for s in self.after]]
        starts = (self.start, *self.after)
        prescribed = [None if s.q is None else _rounded(s.q) for s in starts]
        if any(prescribed):
            content.append(prescribed)
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    @classmethod
    def from_record(cls, record: "ReachRecord", scenario: Scenario) -> Self:
        """Returns the request that a record of a scenario answers."""
        # A record holds the joint angles in any case; its key tells whether they were prescribed.
        start = record.start
        plain = Start(start.x0, start.b0)
        found = [
            cls(scenario, record.stream, record.environment, record.p_WG, first, after)
            for after in _read_after(record, scenario.arm().num_joints)
            for first in ((plain,) if start.q is None else (plain, start))
        ]
        return next((item for item in found if item._key(record.scenario) == record.key), found[0])

    def before(self) -> "ReachRequest | None":
        """Returns the request of the reach that went before; None if it is the first."""
        before = self.after[:-1]
        return replace(self, start=self.after[-1], after=before) if self.after else None

    def then(self, start: Start) -> "ReachRequest":
        """Returns the request of a further reach to the same goal from another start."""
        return replace(self, start=start, after=(*self.after, self.start))


def _significant(x0: Vector) -> list[float]:
    return x0.tolist() if len(x0) == IN_PLANE else _rounded(x0)


def _rounded(values: Vector) -> list[float]:
    return (np.round(values, 9) + 0.0).tolist()


def _check_point(goal: Vector) -> None:
    if goal.shape != (3,) or not np.all(np.isfinite(goal)):
        raise RequestError(f"a goal is three finite numbers in metres, got {goal.tolist()}")


def _checked(scenario: Scenario, start: Start) -> Start:
    """Returns a start of the scenario's robot, without joint angles where there are no others."""
    arm = scenario.arm()
    size = arm.pose_size
    if start.x0.shape != (size,):
        raise RequestError(
            f"a start of {scenario.robot} has {size} numbers ({', '.join(POSE_AXES[size])}), got"
            f" {start.x0.tolist()}"
        )
    if start.q is None:
        return start
    if len(start.q) != arm.num_joints:
        raise RequestError(
            f"{scenario.robot} has {arm.num_joints} joint angles, the start has {len(start.q)}"
        )
    if size == IN_PLANE:
        only = arm.solve_ik(start.x0_R)
        if len(only) and np.allclose(start.q, only[0], rtol=0.0, atol=1e-9):
            return replace(start, q=None)
    return start


def flat_starts(after: tuple[Start, ...]) -> tuple[float, ...]:
    """Returns starts as the numbers of the column `after`: x0, the base, in space the torso.

    If any has joint angles, those follow, NaN for one without.
    """
    angles = next((len(start.q) for start in after if start.q is not None), 0)
    numbers: list[float] = []
    for start in after:
        numbers += start.x0.tolist()
        numbers += start.b0[: 3 if len(start.x0) == IN_SPACE else 2].tolist()
        numbers += [np.nan] * angles if start.q is None else start.q.tolist()
    return tuple(numbers)


def _read_after(record: "ReachRecord", angles: int) -> list[tuple[Start, ...]]:
    """Returns what the column `after` of a record can mean, without and with joint angles."""
    n = len(record.start.x0)
    axes = 3 if n == IN_SPACE else 2
    numbers, found = np.array(record.after), []
    for end in (n + axes, n + axes + angles):
        if len(numbers) % end == 0:
            rows = numbers.reshape(-1, end)
            b0 = np.pad(rows[:, n : n + axes], ((0, 0), (0, 3 - axes)))
            q = rows[:, n + axes :] if end > n + axes else None
            found.append(tuple(Starts(rows[:, :n], b0, q)))
    return found


def _column(unit: str, doc: str, default: Any = MISSING, *, compare: bool = True) -> Any:
    return field(default=default, compare=compare, metadata={"unit": unit, "doc": doc})


@dataclass(frozen=True, kw_only=True)
class ReachRecord:
    """One row of an experience library. SI units, radians, world frame W.

    Every field but `wall_time_s`, which is not compared, is a function of the request. Where a
    reach never began (`invalid_start`, `unreachable`), measured fields are NaN.
    """

    key: str = _column("", "key of the request")
    category: str = _column("", "clutter category")
    robot: str = _column("", "robot")
    scenario: str = _column("", "digest of the scenario")
    stream: str = _column("", "seed stream of the environment")
    environment: int = _column("", "index in the stream")
    goal_x: float = _column("m", "goal p_WG")
    goal_y: float = _column("m", "goal p_WG")
    goal_z: float = _column("m", "goal p_WG")
    start_x: float = _column("m", "start pose x0")
    start_y: float = _column("m", "start pose x0")
    start_phi: float = _column("rad", "start pose x0")
    outcome: str = _column("", "one of OUTCOMES")
    success: bool = _column("", "outcome is reached")
    final_x: float = _column("m", "final hand pose x_inf")
    final_y: float = _column("m", "final hand pose x_inf")
    final_phi: float = _column("rad", "final hand pose x_inf")
    final_vx: float = _column("m/s", "mean tip velocity of the last second of motion")
    final_vy: float = _column("m/s", "mean tip velocity of the last second of motion")
    min_distance: float = _column("m", "smallest distance tip to goal")
    peak_force: float = _column("N", "largest taxel force")
    mean_force: float = _column("N", "mean force of the loaded taxels over the reach")
    peak_contacts: int = _column("", "largest number of loaded taxels")
    mean_contacts: float = _column("", "mean number of loaded taxels")
    duration_s: float = _column("s", "simulated time")
    wall_time_s: float = _column("s", "wall time", compare=False)
    q_start: tuple[float, ...] = _column("rad", "first joint angles")
    q_final: tuple[float, ...] = _column("rad", "last joint angles")
    detail: str = _column("", "why a reach diverged or never began")
    lic_drake_version: str = _column("", "version of lic_drake")
    drake_version: str = _column("", "version of Drake")
    base_x: float = _column("m", "base p_WR", 0.0)
    base_y: float = _column("m", "base p_WR", 0.0)
    after: tuple[float, ...] = _column(
        "m, m, rad, m, m",
        "x0, p_WR and, in space, torso of each reach that went before",
        (),
    )
    torso: float = _column("m", "height of the torso", 0.0)
    start_z: float = _column("m", "start pose x0", 0.0)
    start_qw: float = _column("", "start pose x0, quaternion; all 0 in the plane", 0.0)
    start_qx: float = _column("", "start pose x0, quaternion", 0.0)
    start_qy: float = _column("", "start pose x0, quaternion", 0.0)
    start_qz: float = _column("", "start pose x0, quaternion", 0.0)
    final_z: float = _column("m", "final hand pose x_inf", 0.0)
    final_qw: float = _column("", "final hand pose x_inf, quaternion; all 0 in the plane", 0.0)
    final_qx: float = _column("", "final hand pose x_inf, quaternion", 0.0)
    final_qy: float = _column("", "final hand pose x_inf, quaternion", 0.0)
    final_qz: float = _column("", "final hand pose x_inf, quaternion", 0.0)
    final_vz: float = _column("m/s", "mean tip velocity of the last second of motion", 0.0)
    source: str = _column("", "who made the reach: simulation, a robot", SIMULATION)
    weight: float = _column("", "how many simulated reaches the row counts as", 1.0)

    @property
    def in_space(self) -> bool:
        """Whether the poses have a quaternion, so that the angles phi mean nothing (they are 0)."""
        return any((self.start_qw, self.start_qx, self.start_qy, self.start_qz))

    @property
    def p_WG(self) -> Vector:
        """The goal, shape (3,), metres."""
        return np.array([self.goal_x, self.goal_y, self.goal_z])

    @property
    def start(self) -> Start:
        """The start as in the request, with the joint angles that the reach had there, if any."""
        b0 = np.array([self.base_x, self.base_y, self.torso])
        axes = POSE_AXES[IN_SPACE if self.in_space else IN_PLANE]
        x0 = np.array([getattr(self, f"start_{axis}") for axis in axes])
        return Start(x0, b0, np.array(self.q_start) if self.q_start else None)


def check_goal(scenario: Scenario, p_RG: Vector) -> None:
    """Raises a RequestError for a goal, shape (3,), metres, that is not finite or out of reach."""
    _check_point(p_RG)
    if not is_within_reach(scenario, p_RG):
        arm = scenario.arm()
        distance = np.linalg.norm(p_RG - arm.p_RS)
        shown = ", ".join(f"{x:g}" for x in (p_RG[:2] if arm.is_planar else p_RG))
        raise RequestError(
            f"the goal ({shown}) m is {distance:.3f} m from the"
            f" {'base' if arm.is_planar else 'shoulder'} and the arm reaches"
            f" {_farthest_goal_m(arm, scenario):.3f} m; choose a nearer goal"
        )


def is_within_reach(scenario: Scenario, p_RG: Vector) -> bool:
    """Returns whether the straight arm could come near enough to a goal to succeed."""
    arm = scenario.arm()
    return float(np.linalg.norm(p_RG - arm.p_RS)) < _farthest_goal_m(arm, scenario)


def _farthest_goal_m(arm: Arm, scenario: Scenario) -> float:
    return arm.reach_m + scenario.stop.success_distance_m
