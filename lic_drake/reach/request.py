"""`ReachRequest` and `ReachRecord`: what goes into a reach and what comes out, as plain data."""

import hashlib
import json
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.reach.scenario import Scenario
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

OUTCOMES = ("reached", "stuck", "force", "timeout", "diverged", "invalid_start", "unreachable")
"""How a reach can end: at the goal; without progress; by the force stop; out of time; by a
failure of the simulator; before it began, because the arm cannot stand at the start or because
the goal is further away than the arm is long."""


IN_PLANE, IN_SPACE = 3, 7
"""Lengths of hand poses in the plane and in space."""

_POSES = {IN_PLANE: "x, y, phi", IN_SPACE: "x, y, z, qw, qx, qy, qz"}


class EarlierReach(NamedTuple):
    """A reach to the same goal that went before and left the environment as it is found.

    Attributes:
        start: Hand pose x0 that it began with, in W; in the plane (x, y, phi), metres and radians,
            in space position and quaternion (x, y, z, qw, qx, qy, qz).
        base: p_WR in the plane, (x, y), metres.
        torso: Height of the robot's torso, metres; 0 for a robot without one.
    """

    start: tuple[float, ...]
    base: tuple[float, float]
    torso: float = 0.0

    def flat(self) -> tuple[float, ...]:
        """Returns its numbers one after the other; the torso only where there may be one."""
        return (*self.start, *self.base, *((self.torso,) if len(self.start) == IN_SPACE else ()))


@dataclass(frozen=True, kw_only=True)
class ReachRequest:
    """One reach to simulate. The record is a pure function of it.

    Attributes:
        scenario: Category, robot, contact, controller and stop rules.
        stream: Seed stream of the environment, one of `lic_drake.seeds.STREAMS`.
        environment: Index of the environment in its stream.
        goal: p_WG, (x, y, z), metres.
        start: Hand pose x0 in W; in the plane (x, y, phi), metres and radians, in space position
            and quaternion (x, y, z, qw, qx, qy, qz).
        base: Where the mobile base stands during the reach, p_WR in the plane, (x, y), metres.
        torso: Height of the robot's torso, metres; 0 for a robot without one.
        after: Reaches to the same goal that went before, in their order; without any the
            environment is as it was drawn.
    """

    scenario: Scenario
    stream: str
    environment: int
    goal: tuple[float, float, float]
    start: tuple[float, ...]
    base: tuple[float, float] = (0.0, 0.0)
    torso: float = 0.0
    after: tuple[EarlierReach, ...] = ()

    @property
    def key(self) -> str:
        """Identifies the request in a library: 16 hexadecimal digits."""
        content: list[object] = [self.scenario.digest, self.stream, self.environment]
        content += [self.goal, self.start]
        # Left out where they are as in libraries from before there were any.
        if self.base != (0.0, 0.0) or self.after:
            content += [self.base, [(earlier.start, earlier.base) for earlier in self.after]]
        if len(self.start) == IN_SPACE:
            content += [self.torso, [earlier.torso for earlier in self.after]]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    @property
    def p_WR(self) -> Vector:
        """Position of the base, shape (3,), metres."""
        return np.array([*self.base, 0.0])

    def before(self) -> "ReachRequest | None":
        """Returns the request of the reach that went before; None if it is the first."""
        if not self.after:
            return None
        last = self.after[-1]
        return replace(
            self, start=last.start, base=last.base, torso=last.torso, after=self.after[:-1]
        )

    def then(self, x0: Vector, p_WR: Vector, torso_m: float | None = None) -> "ReachRequest":
        """Returns the request of a further reach to the same goal.

        Args:
            x0: Its start pose, shape (3,), or (7,) in space.
            p_WR: Its base, shape (2,) or (3,), metres.
            torso_m: Its torso's height, metres; by default the present one.
        """
        earlier = EarlierReach(start=self.start, base=self.base, torso=self.torso)
        return replace(
            self,
            start=_numbers(x0),
            base=_pair(p_WR),
            torso=self.torso if torso_m is None else float(torso_m),
            after=(*self.after, earlier),
        )


def make_request(
    scenario: Scenario,
    stream: str,
    environment: int,
    p_WG: Vector,
    x0: Vector,
    p_WR: Vector | None = None,
    torso_m: float | None = None,
) -> ReachRequest:
    """Returns the request of a first reach from arrays.

    Args:
        scenario: Category, robot and rules.
        stream: Seed stream of the environment.
        environment: Its index.
        p_WG: Goal, shape (3,), metres.
        x0: Start pose, shape (3,), or (7,) in space.
        p_WR: Base, shape (2,) or (3,), metres; by default at the origin.
        torso_m: Height of the torso, metres; by default as the scenario's task has it.

    Raises:
        RequestError: The robot has start poses of another kind.
    """
    size = IN_PLANE if scenario.arm().surface is None else IN_SPACE
    if x0.shape != (size,):
        raise RequestError(
            f"a start of {scenario.robot} has {size} numbers ({_POSES[size]}), got {x0.tolist()}"
        )
    return ReachRequest(
        scenario=scenario,
        stream=stream,
        environment=environment,
        goal=_triple(p_WG),
        start=_numbers(x0),
        base=(0.0, 0.0) if p_WR is None else _pair(p_WR),
        torso=scenario.task.torso_m if torso_m is None else float(torso_m),
    )


def _numbers(values: Vector) -> tuple[float, ...]:
    return tuple(np.asarray(values, dtype=float).tolist())


def _triple(values: Vector) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _pair(values: Vector) -> tuple[float, float]:
    # Adding zero makes -0.0 and 0.0 the same base with the same key.
    return float(values[0]) + 0.0, float(values[1]) + 0.0


def _later(unit: str, doc: str) -> float:
    """Returns a column of schema version 3; 0 in the plane and in tables from before it."""
    column: float = field(default=0.0, metadata={"unit": unit, "doc": doc, "since": 3})
    return column


@dataclass(frozen=True, kw_only=True)
class ReachRecord:
    """One row of an experience library. SI units, radians, world frame W.

    Every field but `wall_time_s` is a function of the request; that one is left out when
    records are compared. Where a reach never began (`invalid_start`,
    `unreachable`), measured fields are NaN.
    """

    key: str = field(metadata={"unit": "", "doc": "key of the request"})
    category: str = field(metadata={"unit": "", "doc": "clutter category"})
    robot: str = field(metadata={"unit": "", "doc": "robot"})
    scenario: str = field(metadata={"unit": "", "doc": "digest of the scenario"})
    stream: str = field(metadata={"unit": "", "doc": "seed stream of the environment"})
    environment: int = field(metadata={"unit": "", "doc": "index in the stream"})
    goal_x: float = field(metadata={"unit": "m", "doc": "goal p_WG"})
    goal_y: float = field(metadata={"unit": "m", "doc": "goal p_WG"})
    goal_z: float = field(metadata={"unit": "m", "doc": "goal p_WG"})
    start_x: float = field(metadata={"unit": "m", "doc": "start pose x0"})
    start_y: float = field(metadata={"unit": "m", "doc": "start pose x0"})
    start_phi: float = field(metadata={"unit": "rad", "doc": "start pose x0"})
    outcome: str = field(metadata={"unit": "", "doc": "one of OUTCOMES"})
    success: bool = field(metadata={"unit": "", "doc": "outcome is reached"})
    final_x: float = field(metadata={"unit": "m", "doc": "final hand pose x_inf"})
    final_y: float = field(metadata={"unit": "m", "doc": "final hand pose x_inf"})
    final_phi: float = field(metadata={"unit": "rad", "doc": "final hand pose x_inf"})
    final_vx: float = field(
        metadata={"unit": "m/s", "doc": "mean tip velocity of the last second of motion"}
    )
    final_vy: float = field(
        metadata={"unit": "m/s", "doc": "mean tip velocity of the last second of motion"}
    )
    min_distance: float = field(metadata={"unit": "m", "doc": "smallest distance tip to goal"})
    peak_force: float = field(metadata={"unit": "N", "doc": "largest taxel force"})
    mean_force: float = field(
        metadata={"unit": "N", "doc": "mean force of the loaded taxels over the reach"}
    )
    peak_contacts: int = field(metadata={"unit": "", "doc": "largest number of loaded taxels"})
    mean_contacts: float = field(metadata={"unit": "", "doc": "mean number of loaded taxels"})
    duration_s: float = field(metadata={"unit": "s", "doc": "simulated time"})
    wall_time_s: float = field(compare=False, metadata={"unit": "s", "doc": "wall time"})
    q_start: tuple[float, ...] = field(metadata={"unit": "rad", "doc": "first joint angles"})
    q_final: tuple[float, ...] = field(metadata={"unit": "rad", "doc": "last joint angles"})
    detail: str = field(metadata={"unit": "", "doc": "why a reach diverged or never began"})
    lic_drake_version: str = field(metadata={"unit": "", "doc": "version of lic_drake"})
    drake_version: str = field(metadata={"unit": "", "doc": "version of Drake"})
    base_x: float = field(default=0.0, metadata={"unit": "m", "doc": "base p_WR", "since": 2})
    base_y: float = field(default=0.0, metadata={"unit": "m", "doc": "base p_WR", "since": 2})
    after: tuple[float, ...] = field(
        default=(),
        metadata={
            "unit": "m, m, rad, m, m",
            "doc": "x0, p_WR and, in space, torso of each reach that went before",
            "since": 2,
        },
    )
    torso: float = _later("m", "height of the torso")
    start_z: float = _later("m", "start pose x0")
    start_qw: float = _later("", "start pose x0, quaternion; all 0 in the plane")
    start_qx: float = _later("", "start pose x0, quaternion")
    start_qy: float = _later("", "start pose x0, quaternion")
    start_qz: float = _later("", "start pose x0, quaternion")
    final_z: float = _later("m", "final hand pose x_inf")
    final_qw: float = _later("", "final hand pose x_inf, quaternion; all 0 in the plane")
    final_qx: float = _later("", "final hand pose x_inf, quaternion")
    final_qy: float = _later("", "final hand pose x_inf, quaternion")
    final_qz: float = _later("", "final hand pose x_inf, quaternion")
    final_vz: float = _later("m/s", "mean tip velocity of the last second of motion")

    @property
    def in_space(self) -> bool:
        """Whether the poses have a quaternion, so that the angles phi mean nothing (they are 0)."""
        quaternion = (self.start_qw, self.start_qx, self.start_qy, self.start_qz)
        return quaternion != (0.0, 0.0, 0.0, 0.0)

    @property
    def p_WG(self) -> Vector:
        """The goal, shape (3,), metres."""
        return np.array([self.goal_x, self.goal_y, self.goal_z])

    @property
    def x0(self) -> Vector:
        """The start pose: (x, y, phi), or position and quaternion in space, as in the request."""
        if not self.in_space:
            return np.array([self.start_x, self.start_y, self.start_phi])
        quaternion = (self.start_qw, self.start_qx, self.start_qy, self.start_qz)
        return np.array([self.start_x, self.start_y, self.start_z, *quaternion])


def request_of(record: ReachRecord, scenario: Scenario) -> ReachRequest:
    """Returns the request that a record answers; `scenario` is the one that it was made with."""
    n = len(record.x0)
    width = n + (3 if record.in_space else 2)
    rows = [record.after[i : i + width] for i in range(0, len(record.after), width)]
    return ReachRequest(
        scenario=scenario,
        stream=record.stream,
        environment=record.environment,
        goal=_triple(record.p_WG),
        start=_numbers(record.x0),
        base=(record.base_x, record.base_y),
        torso=record.torso,
        after=tuple(EarlierReach(row[:n], (row[n], row[n + 1]), *row[n + 2 :]) for row in rows),
    )


def check_goal(scenario: Scenario, p_RG: Vector, torso_m: float | None = None) -> None:
    """Refuses goals that no reach could come to.

    Args:
        scenario: Robot and success distance.
        p_RG: The goal as seen from the base, shape (3,), metres.
        torso_m: Height of the torso, metres; by default as the scenario's task has it.

    Raises:
        RequestError: The goal is not finite or further away than the arm reaches.
    """
    if p_RG.shape != (3,) or not np.all(np.isfinite(p_RG)):
        raise RequestError(f"a goal is two finite numbers in metres, got {p_RG.tolist()}")
    if not is_within_reach(scenario, p_RG, torso_m):
        arm = scenario.arm(torso_m)
        distance = np.linalg.norm(p_RG - arm.p_RS)
        shown = ", ".join(f"{x:g}" for x in (p_RG[:2] if arm.surface is None else p_RG))
        raise RequestError(
            f"the goal ({shown}) m is {distance:.3f} m from the"
            f" {'base' if arm.surface is None else 'shoulder'} and the arm reaches"
            f" {_farthest_goal_m(arm, scenario):.3f} m; choose a nearer goal"
        )


def is_within_reach(scenario: Scenario, p_RG: Vector, torso_m: float | None = None) -> bool:
    """Tells whether the straight arm could come near enough to a goal to succeed.

    Args:
        scenario: Robot and success distance.
        p_RG: The goal, shape (3,), metres.
        torso_m: Height of the torso, metres; by default as the scenario's task has it.
    """
    arm = scenario.arm(torso_m)
    return float(np.linalg.norm(p_RG - arm.p_RS)) < _farthest_goal_m(arm, scenario)


def _farthest_goal_m(arm: Arm, scenario: Scenario) -> float:
    return arm.reach_m + scenario.stop.success_distance_m
