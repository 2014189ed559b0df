"""RND and COST, the strategies that the paper compares LIC with (VI-A)."""

import time
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from scipy.spatial.transform import Rotation

from lic_drake.errors import RequestError
from lic_drake.reach.start import IN_PLANE, IN_SPACE
from lic_drake.robots.arm import Arm
from lic_drake.select.situation import Selection, Situation
from lic_drake.types import Vector

OBJECT_RADIUS_M = {IN_PLANE: 0.01, IN_SPACE: 0.05}
"""Radius of an object of the clutter, metres: cylinders in the plane, spheres in space."""


class Hand(NamedTuple):
    """The last link: distance of the tip from its joint, and its largest radius, metres."""

    length_m: float
    radius_m: float

    @classmethod
    def of(cls, arm: Arm) -> Self:
        """Returns the hand of an arm."""
        last, tip = arm.p_RJ[-2:]
        shapes = [s.enclosing_capsule() for s in arm.skin if s.link == arm.link_names[-1]]
        return cls(float(np.linalg.norm(tip - last)), max(shape.size[0] for shape in shapes))


def corridor_cost(x0: Vector, p_WG: Vector, hand: Hand) -> Vector:
    """Returns what the last link sweeps on the straight way to the goal, shape (n,).

    Times the clutter's density it is the expected number of contacts, the paper's "minimum-contact
    corridor". The paper gives no formula; these are ours, with r = r_hand + r_object and the angle
    delta between the hand and the way:

        in the plane  C = d (2 r + l s(delta)),  s = sin(delta) up to 90 degrees, else 1
        in space      C = d (pi r^2 + 2 r l s(delta))

    Args:
        x0: Start poses, shape (n, 3), or (n, 7) in space.
        p_WG: Goal, shape (3,), metres.
        hand: The last link.
    """
    in_plane = x0.shape[1] == IN_PLANE
    position = slice(0, 2 if in_plane else 3)
    way = p_WG[position] - x0[:, position]
    distance = np.linalg.norm(way, axis=1)
    if in_plane:
        direction = np.column_stack([np.cos(x0[:, 2]), np.sin(x0[:, 2])])
    else:
        direction = Rotation.from_quat(x0[:, 3:], scalar_first=True).apply([1.0, 0.0, 0.0])
    cos_delta = np.sum(way * direction, axis=1) / np.maximum(distance, 1e-12)
    sin_delta = np.sqrt(np.maximum(0.0, 1.0 - cos_delta**2))
    aside = hand.length_m * np.where(cos_delta >= 0.0, sin_delta, 1.0)
    r = hand.radius_m + OBJECT_RADIUS_M[x0.shape[1]]
    return distance * (2.0 * r + aside if in_plane else np.pi * r**2 + 2.0 * r * aside)


@dataclass(frozen=True, kw_only=True)
class RandomSelector:
    """RND: any of the discrete starts, all equally likely in every attempt (VI-A).

    The paper rules out the failed start and what is near it for COST only, so RND may repeat one.
    """

    rng: np.random.Generator
    method: str = "rnd"

    def select(self, situation: Situation) -> Selection:
        """Draws a start; a RequestError if there is none."""
        began = time.perf_counter()
        choices = situation.starts.grid
        if len(choices) == 0:
            raise RequestError("no discrete start is feasible here, so there is none to draw")
        start = choices[int(self.rng.integers(len(choices)))]
        return Selection(start, None, self.method, time.perf_counter() - began)


@dataclass(frozen=True, kw_only=True)
class CostSelector:
    """COST: the discrete start with the smallest corridor cost, away from failed ones.

    Of equal ones, in the plane the shoulder is nearest to the goal across x, where most of the
    arm's length is left for the way in. A PR2 moves as little as it can: with its shoulder before
    the goal the forearm jams in the aperture, and COST came to 9 % of the goals instead of 31 %.
    """

    method: str = "cost"

    def select(self, situation: Situation) -> Selection:
        """Returns the best start; a RequestError if none is left."""
        began = time.perf_counter()
        starts = situation.starts
        choices = starts.grid.take(situation.allowed(starts.grid))
        if len(choices) == 0:
            raise RequestError("no discrete start is left away from the failed ones")
        cost = corridor_cost(choices.x0, situation.p_WG, Hand.of(starts.arm))
        if starts.home is None:
            second = np.abs((choices.b0 + starts.arm.p_RS - situation.p_WG)[:, 1])
        else:
            second = np.linalg.norm(choices.b0 - starts.home, axis=1)
        # Rounded: equal poses have equal costs but for the last digits.
        start = choices[int(np.lexsort([second, np.round(cost, 9)])[0])]
        return Selection(start, None, self.method, time.perf_counter() - began)
