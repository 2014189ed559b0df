"""RND and COST, the strategies that the paper compares LIC with (VI-A)."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.select.situation import Selection, Situation

Vector = NDArray[np.float64]

HAND_LENGTH_M = 0.288
HAND_RADIUS_M = 0.015
OBJECT_RADIUS_M = 0.01


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
        grid = situation.starts.grid
        used = np.zeros(len(grid), dtype=bool)
        for failed in situation.failed:
            used |= np.all(np.isclose(grid, failed), axis=1)
        choices = grid[~used]
        if len(choices) == 0:
            raise RequestError("all discrete starts have failed; no start is left to draw")
        return make_selection(
            situation, choices[self.rng.integers(len(choices))], None, self.method, began
        )


@dataclass(frozen=True, kw_only=True)
class CostSelector:
    """COST: the discrete start with the smallest corridor cost, away from failed ones."""

    method: str = "cost"

    def select(self, situation: Situation) -> Selection:
        """Returns the best start."""
        began = time.perf_counter()
        grid = situation.starts.grid
        choices = grid[situation.allowed(grid)]
        if len(choices) == 0:
            raise RequestError("no discrete start is left away from the failed ones")
        best = choices[np.argmin(corridor_cost(choices, situation.p_WG))]
        return make_selection(situation, best, None, self.method, began)


def make_selection(
    situation: Situation, x0: Vector, probability: float | None, method: str, began: float
) -> Selection:
    """Returns a selection after checking it with the closed-form inverse kinematics.

    Args:
        situation: What was asked.
        x0: The chosen pose.
        probability: Its estimated probability of success, if there is an estimate.
        method: Name of the strategy.
        began: `time.perf_counter()` at the beginning of the selection.

    Raises:
        RequestError: The arm cannot take the pose.
    """
    q = situation.starts.arm.solve_ik(x0)
    if q is None or not situation.starts.contains(x0):
        raise RequestError(f"the arm cannot start at {np.round(x0, 4).tolist()}")
    return Selection(
        x0=x0,
        q=q,
        probability=probability,
        method=method,
        seconds=time.perf_counter() - began,
    )
