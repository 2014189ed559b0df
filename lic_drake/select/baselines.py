"""RND and COST, the strategies that the paper compares LIC with (VI-A)."""

import time
from dataclasses import dataclass, field

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.select.situation import Selection, Situation
from lic_drake.types import Vector

HAND_LENGTH_M = 0.288
"""Length of the last link with the tip, metres."""
HAND_RADIUS_M = 0.015
"""Radius of its skin, metres."""
OBJECT_RADIUS_M = 0.01
"""Radius of a cylinder, metres."""

PR2_HAND_LENGTH_M = 0.18
"""From the PR2's wrist to its tool, metres."""
PR2_HAND_RADIUS_M = 0.06
"""Radius of its gripper, metres."""
SPHERE_RADIUS_M = 0.05
"""Radius of the floating spheres, metres."""


def corridor_cost(x0: Vector, p_WG: Vector) -> Vector:
    """Returns what the last link sweeps on the straight way to the goal, shape (n,).

    Divided by the clutter's density it is the expected number of contacts, the paper's
    "minimum-contact corridor": it grows with the distance to the goal and with the angle between
    the hand and the way. The paper gives no formula; these are ours, with r = r_hand + r_object:

        in the plane  C = d (2 r + l s(delta)),  s = sin(delta) up to 90 degrees, else 1
        in space      C = d (pi r^2 + 2 r l s(delta))

    Args:
        x0: Start poses, (x, y, phi), shape (n, 3), or position and quaternion, shape (n, 7).
        p_WG: Goal, shape (3,), metres.

    Returns:
        Cost, shape (n,), square metres, in space cubic metres.
    """
    in_plane = x0.shape[1] == IN_PLANE
    position = slice(0, 2 if in_plane else 3)
    way = p_WG[position] - x0[:, position]
    distance = np.linalg.norm(way, axis=1)
    if in_plane:
        hand = np.column_stack([np.cos(x0[:, 2]), np.sin(x0[:, 2])])
    else:
        w, x, y, z = x0[:, 3:].T
        hand = np.column_stack(
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        )
    cos_delta = np.sum(way * hand, axis=1) / np.maximum(distance, 1e-12)
    sin_delta = np.sqrt(np.maximum(0.0, 1.0 - cos_delta**2))
    aside = np.where(cos_delta >= 0.0, sin_delta, 1.0)
    if in_plane:
        return distance * (2.0 * (HAND_RADIUS_M + OBJECT_RADIUS_M) + HAND_LENGTH_M * aside)
    r = PR2_HAND_RADIUS_M + SPHERE_RADIUS_M
    return distance * (np.pi * r**2 + 2.0 * r * PR2_HAND_LENGTH_M * aside)


@dataclass(frozen=True, kw_only=True)
class RandomSelector:
    """RND: any of the discrete starts, all equally likely; a retry takes any other one.

    Attributes:
        rng: Source of the draws.
    """

    rng: np.random.Generator
    method: str = "rnd"

    def select(self, situation: Situation) -> Selection:
        """Draws a start."""
        began = time.perf_counter()
        choices = situation.starts.grid.take(situation.untried(situation.starts.grid))
        if len(choices) == 0:
            raise RequestError("all discrete starts have failed; no start is left to draw")
        i = int(self.rng.integers(len(choices)))
        return make_selection(situation, choices, i, None, self.method, began)


@dataclass(frozen=True, kw_only=True)
class CostSelector:
    """COST: the discrete start with the smallest corridor cost, away from failed ones.

    A mobile base and a torso add nothing to the corridor. In the plane, of equal ones that is taken
    whose shoulder is nearest to the goal across x, where most of the arm's length is left for the
    way in. A PR2 moves as little as it can: with its shoulder before the goal the forearm jams in
    the aperture, and COST came to 9 % of the goals instead of 31 %.

    Attributes:
        p_RS: The shoulder about which the arm turns, shape (3,), metres.
        stays: Whether base and torso move as little as they can.
    """

    p_RS: Vector = field(default_factory=lambda: np.zeros(3))
    stays: bool = False
    method: str = "cost"

    def select(self, situation: Situation) -> Selection:
        """Returns the best start."""
        began = time.perf_counter()
        choices = situation.starts.grid.take(situation.allowed(situation.starts.grid))
        if len(choices) == 0:
            raise RequestError("no discrete start is left away from the failed ones")
        cost = corridor_cost(choices.x0, situation.p_WG)
        if not self.stays:
            second = np.abs((choices.b0 + self.p_RS - situation.p_WG)[:, 1])
        else:
            assert isinstance(situation.starts, PointingStarts)
            torso_m = situation.starts.scenario.task.torso_m
            second = np.linalg.norm(choices.b0 - [0.0, 0.0, torso_m], axis=1)
        # Rounded: equal poses have equal costs but for the last digits.
        i = int(np.lexsort([second, np.round(cost, 9)])[0])
        return make_selection(situation, choices, i, None, self.method, began)


def make_selection(
    situation: Situation,
    conditions: Starts,
    index: int,
    probability: float | None,
    method: str,
    began: float,
) -> Selection:
    """Returns a selection after checking it with the closed-form inverse kinematics.

    Args:
        situation: What was asked.
        conditions: Initial conditions.
        index: Which of them was chosen.
        probability: Its estimated probability of success, if there is an estimate.
        method: Name of the strategy.
        began: `time.perf_counter()` at the beginning of the selection.

    Raises:
        RequestError: The arm cannot start there.
    """
    x0, b0 = conditions.x0[index], conditions.b0[index]
    q = situation.starts.angles(x0, b0[:2], float(b0[2]))
    if q is None:
        raise RequestError(
            f"the arm cannot start at {np.round(x0, 4).tolist()} from a base at"
            f" {np.round(b0[:2], 4).tolist()} with the torso at {b0[2]:.4f} m"
        )
    return Selection(
        start=Start(x0, b0, q),
        probability=probability,
        method=method,
        seconds=time.perf_counter() - began,
    )
