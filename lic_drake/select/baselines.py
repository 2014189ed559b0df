"""RND and COST, the strategies that the paper compares LIC with (VI-A)."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.reach.starts import is_possible
from lic_drake.select.situation import Selection, Situation

Vector = NDArray[np.float64]

HAND_LENGTH_M = 0.288
"""Length of the last link with the tip, metres."""
HAND_RADIUS_M = 0.015
"""Radius of its skin, metres."""
OBJECT_RADIUS_M = 0.01
"""Radius of a cylinder, metres."""


def corridor_cost(x0: Vector, p_WG: Vector) -> Vector:
    """Returns the area that the last link sweeps on the straight way to the goal, shape (n,).

    Divided by the clutter's density it is the expected number of contacts, the paper's
    "minimum-contact corridor": it grows with the distance to the goal and with the angle between
    the hand and the way. The paper gives no formula; this one is ours:

        C = d (2 (r_hand + r_object) + l s(delta)),  s = sin(delta) up to 90 degrees, else 1

    Args:
        x0: Start poses (x, y, phi), shape (n, 3), metres and radians.
        p_WG: Goal, shape (3,), metres.

    Returns:
        Cost, shape (n,), square metres.
    """
    way = p_WG[:2] - x0[:, :2]
    distance = np.linalg.norm(way, axis=1)
    hand = np.column_stack([np.cos(x0[:, 2]), np.sin(x0[:, 2])])
    cos_delta = np.sum(way * hand, axis=1) / np.maximum(distance, 1e-12)
    sin_delta = np.sqrt(np.maximum(0.0, 1.0 - cos_delta**2))
    width = 2.0 * (HAND_RADIUS_M + OBJECT_RADIUS_M)
    return distance * (width + HAND_LENGTH_M * np.where(cos_delta >= 0.0, sin_delta, 1.0))


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
        if len(choices.x0) == 0:
            raise RequestError("all discrete starts have failed; no start is left to draw")
        i = self.rng.integers(len(choices.x0))
        return make_selection(situation, choices.x0[i], choices.p_WR[i], None, self.method, began)


@dataclass(frozen=True, kw_only=True)
class CostSelector:
    """COST: the discrete start with the smallest corridor cost, away from failed ones.

    A mobile base adds nothing to the corridor; of equal ones that is taken whose base is nearest
    to the goal's y, where most of the arm's length is left for the way in.
    """

    method: str = "cost"

    def select(self, situation: Situation) -> Selection:
        """Returns the best start."""
        began = time.perf_counter()
        choices = situation.starts.grid.take(situation.allowed(situation.starts.grid))
        if len(choices.x0) == 0:
            raise RequestError("no discrete start is left away from the failed ones")
        cost = corridor_cost(choices.x0, situation.p_WG)
        aside = np.abs(choices.p_WR[:, 1] - situation.p_WG[1])
        # Rounded: equal poses have equal costs but for the last digits.
        i = np.lexsort([aside, np.round(cost, 9)])[0]
        return make_selection(situation, choices.x0[i], choices.p_WR[i], None, self.method, began)


def make_selection(
    situation: Situation,
    x0: Vector,
    p_WR: Vector,
    probability: float | None,
    method: str,
    began: float,
) -> Selection:
    """Returns a selection after checking it with the closed-form inverse kinematics.

    Args:
        situation: What was asked.
        x0: The chosen pose, shape (3,).
        p_WR: The chosen base, shape (2,), metres.
        probability: Its estimated probability of success, if there is an estimate.
        method: Name of the strategy.
        began: `time.perf_counter()` at the beginning of the selection.

    Raises:
        RequestError: The arm cannot take the pose.
    """
    starts = situation.starts
    q = starts.poses.arm.solve_ik(x0 - [*p_WR, 0.0])
    if q is None or not is_possible(starts, x0, p_WR):
        raise RequestError(
            f"the arm cannot start at {np.round(x0, 4).tolist()} from a base at"
            f" {np.round(p_WR, 4).tolist()}"
        )
    return Selection(
        x0=x0,
        p_WR=p_WR,
        q=q,
        probability=probability,
        method=method,
        seconds=time.perf_counter() - began,
    )
