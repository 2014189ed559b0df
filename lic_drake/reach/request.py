"""`ReachRequest` and `ReachRecord`: what goes into a reach and what comes out, as plain data."""

import hashlib
import json
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.reach.scenario import Scenario

OUTCOMES = ("reached", "stuck", "force", "timeout", "diverged", "invalid_start", "unreachable")
"""How a reach can end: at the goal; without progress; by the force stop; out of time; by a
failure of the simulator; before it began, because the arm cannot stand at the start or because
the goal is further away than the arm is long."""


class EarlierReach(NamedTuple):
    """A reach to the same goal that went before and left the environment as it is found.

    Attributes:
        start: Hand pose x0 that it began with, in W; in the plane (x, y, phi), metres and radians.
        base: p_WR in the plane, (x, y), metres.
    """

    start: tuple[float, float, float]
    base: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class ReachRequest:
    """One reach to simulate. The record is a pure function of it.

    Attributes:
        scenario: Category, robot, contact, controller and stop rules.
        stream: Seed stream of the environment, one of `lic_drake.seeds.STREAMS`.
        environment: Index of the environment in its stream.
        goal: p_WG, (x, y, z), metres.
        start: Hand pose x0 in W; in the plane (x, y, phi), metres and radians.
        base: Where the mobile base stands during the reach, p_WR in the plane, (x, y), metres.
        after: Reaches to the same goal that went before, in their order; without any the
            environment is as it was drawn.
    """

    scenario: Scenario
    stream: str
    environment: int
    goal: tuple[float, float, float]
    start: tuple[float, float, float]
    base: tuple[float, float] = (0.0, 0.0)
    after: tuple[EarlierReach, ...] = ()

    @property
    def key(self) -> str:
        """Identifies the request in a library: 16 hexadecimal digits."""
        content = [self.scenario.digest, self.stream, self.environment, self.goal, self.start]
        # Left out where they are as in libraries from before there were any.
        if self.base != (0.0, 0.0) or self.after:
            content += [self.base, self.after]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]

    @property
    def p_WR(self) -> NDArray[np.float64]:
        """Position of the base, shape (3,), metres."""
        return np.array([*self.base, 0.0])

    def before(self) -> "ReachRequest | None":
        """Returns the request of the reach that went before; None if it is the first."""
        if not self.after:
            return None
        last = self.after[-1]
        return replace(self, start=last.start, base=last.base, after=self.after[:-1])

    def then(self, x0: NDArray[np.float64], p_WR: NDArray[np.float64]) -> "ReachRequest":
        """Returns the request of a further reach to the same goal.

        Args:
            x0: Its start pose, shape (3,).
            p_WR: Its base, shape (2,) or (3,), metres.
        """
        earlier = EarlierReach(start=self.start, base=self.base)
        return replace(self, start=_triple(x0), base=_pair(p_WR), after=(*self.after, earlier))


def make_request(
    scenario: Scenario,
    stream: str,
    environment: int,
    p_WG: NDArray[np.float64],
    x0: NDArray[np.float64],
    p_WR: NDArray[np.float64] | None = None,
) -> ReachRequest:
    """Returns the request of a first reach from arrays.

    Args:
        scenario: Category, robot and rules.
        stream: Seed stream of the environment.
        environment: Its index.
        p_WG: Goal, shape (3,), metres.
        x0: Start pose, shape (3,).
        p_WR: Base, shape (2,) or (3,), metres; by default at the origin.
    """
    return ReachRequest(
        scenario=scenario,
        stream=stream,
        environment=environment,
        goal=_triple(p_WG),
        start=_triple(x0),
        base=(0.0, 0.0) if p_WR is None else _pair(p_WR),
    )


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _pair(values: NDArray[np.float64]) -> tuple[float, float]:
    # Adding zero makes -0.0 and 0.0 the same base with the same key.
    return float(values[0]) + 0.0, float(values[1]) + 0.0


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
            "doc": "x0 and p_WR of each reach that went before",
            "since": 2,
        },
    )

    @property
    def p_WG(self) -> NDArray[np.float64]:
        """The goal, shape (3,), metres."""
        return np.array([self.goal_x, self.goal_y, self.goal_z])

    @property
    def x0(self) -> NDArray[np.float64]:
        """The start pose (x, y, phi), metres and radians."""
        return np.array([self.start_x, self.start_y, self.start_phi])


def request_of(record: ReachRecord, scenario: Scenario) -> ReachRequest:
    """Returns the request that a record answers; `scenario` is the one that it was made with."""
    after = np.array(record.after).reshape(-1, 5)
    return ReachRequest(
        scenario=scenario,
        stream=record.stream,
        environment=record.environment,
        goal=_triple(record.p_WG),
        start=_triple(record.x0),
        base=(record.base_x, record.base_y),
        after=tuple(EarlierReach(start=_triple(row[:3]), base=_pair(row[3:])) for row in after),
    )


def check_goal(scenario: Scenario, p_WG: NDArray[np.float64]) -> None:
    """Refuses goals that no reach could come to.

    Raises:
        RequestError: The goal is not finite or further away than the arm reaches.
    """
    if p_WG.shape != (3,) or not np.all(np.isfinite(p_WG)):
        raise RequestError(f"a goal is two finite numbers in metres, got {p_WG.tolist()}")
    if not is_within_reach(scenario, p_WG):
        raise RequestError(
            f"the goal ({p_WG[0]:g}, {p_WG[1]:g}) m is {np.linalg.norm(p_WG):.3f} m from the base"
            f" and the arm reaches {_farthest_goal_m(scenario):.3f} m; choose a nearer goal"
        )


def is_within_reach(scenario: Scenario, p_WG: NDArray[np.float64]) -> bool:
    """Tells whether the straight arm could come near enough to a goal, shape (3,), to succeed."""
    return float(np.linalg.norm(p_WG)) < _farthest_goal_m(scenario)


def _farthest_goal_m(scenario: Scenario) -> float:
    return scenario.arm().reach_m + scenario.stop.success_distance_m
