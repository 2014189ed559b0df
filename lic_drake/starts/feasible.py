"""`Region`, a box of where a reach may start, and `FeasibleStarts`, what all families offer."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.robots.arm import Arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.types import IntVector, Vector

TOLERANCE = 1e-6
"""A hand or a base this near to the bounds, in metres or radians, counts as inside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """A box of x0 in W, shape (3,) or in space (7,), and b0, one part of Eq. (4).

    Joint limits and collisions apart, all of it is feasible.
    """

    lower: Vector
    upper: Vector
    b0_lower: Vector
    b0_upper: Vector

    def holds(self, x0: Vector, b0: Vector, tolerance: float = TOLERANCE) -> bool:
        """Returns whether a hand pose from a base lies in the box."""
        pairs = ((x0, self.lower, self.upper), (b0, self.b0_lower, self.b0_upper))
        return all(
            bool(np.all((value >= low - tolerance) & (value <= high + tolerance)))
            for value, low, high in pairs
        )

    def clip(self, x0: Vector, b0: Vector) -> tuple[Vector, Vector]:
        """Returns the nearest hand pose and base in the box; a quaternion has norm 1."""
        x0, b0 = np.clip(x0, self.lower, self.upper), np.clip(b0, self.b0_lower, self.b0_upper)
        if len(x0) > IN_PLANE:
            x0[3:] /= np.linalg.norm(x0[3:])
        return x0, b0

    @property
    def position(self) -> tuple[Vector, Vector]:
        """Bounds of the hand's position, each shape (3,), metres."""
        if len(self.lower) == IN_PLANE:
            return np.append(self.lower[:2], 0.0), np.append(self.upper[:2], 0.0)
        return self.lower[:3], self.upper[:3]

    @property
    def cone(self) -> tuple[Vector, float]:
        """The direction about which the hand points, shape (3,), and by how much it may differ.

        In space the hand points along Wx and may only turn about it.
        """
        if len(self.lower) > IN_PLANE:
            return np.array([1.0, 0.0, 0.0]), 0.0
        low, high = self.lower[2], self.upper[2]
        middle = 0.5 * (low + high)
        return np.array([np.cos(middle), np.sin(middle), 0.0]), float(0.5 * (high - low))

    def away_from(self, failed: Iterable[Start], distance_m: float) -> "list[Region]":
        """Returns what is left of a region in the plane away from failed hands in y."""
        parts = [self]
        for start in failed:
            ends = start.x0[1] - distance_m, start.x0[1] + distance_m
            parts = [cut for part in parts for cut in part._without(*ends)]
        return parts

    def _without(self, low: float, high: float) -> "list[Region]":
        """Returns what is left of a line without the y from low to high."""
        before, after = self.upper.copy(), self.lower.copy()
        before[1], after[1] = min(before[1], low), max(after[1], high)
        cut = [replace(self, upper=before), replace(self, lower=after)]
        return [part for part in cut if part.lower[1] <= part.upper[1]]


def find_regions(regions: Sequence[Region], some: Starts) -> IntVector:
    """Returns which region holds each of n starts, up to the rounding of grids; -1 for none."""
    found = np.full(len(some), -1)
    x0_b0 = np.hstack([some.x0, some.b0])
    for k in reversed(range(len(regions))):
        region = regions[k]
        low = np.append(region.lower, region.b0_lower) - 1e-5
        high = np.append(region.upper, region.b0_upper) + 1e-5
        found[np.all((x0_b0 >= low) & (x0_b0 <= high), axis=1)] = k
    return found


class Effort(NamedTuple):
    """How thoroughly a selection searches: from how many candidates the program is solved.

    A region whose best candidate is `max_gain` below the best so far is skipped.
    """

    solves: int = 6
    solves_per_region: int = 6
    max_gain: float = np.inf


class FeasibleStarts(ABC):
    """The initial conditions (x0, b0) that are feasible for an arm in an environment."""

    effort = Effort()

    @property
    @abstractmethod
    def arm(self) -> Arm:
        """The robot."""

    @property
    @abstractmethod
    def regions(self) -> tuple[Region, ...]:
        """Boxes that hold all of them."""

    @property
    @abstractmethod
    def grid(self) -> Starts:
        """The discrete ones with their joint angles, from which RND and COST choose."""

    @abstractmethod
    def lattice(self, values: Vector) -> Starts:
        """Returns denser candidates than the grid, where its estimates are not -inf."""

    @abstractmethod
    def solve(self, x0: Vector, b0: Vector, near: Vector | None = None) -> Vector | None:
        """Returns joint angles with which the arm can start so, perhaps near others, else None."""

    @abstractmethod
    def training(self, stream: str, environment: int) -> Starts:
        """Returns those that a collection tries in the environment, without joint angles."""

    @property
    def checker(self) -> CollisionChecker | None:
        """The mobile robot and what it must keep away from; None if no start comes near it."""
        return None

    @property
    def home(self) -> Vector | None:
        """Base and torso from which the robot prefers not to move, shape (3,), metres, if any."""
        return None

    def chance(self, x0: Vector) -> Vector:
        """Returns the probability that n hand poses are feasible, shape (n,); 1 by default."""
        return np.ones(len(x0))

    def nearest(self, x0: Vector, b0: Vector) -> Start | None:
        """Returns the preferred start with this hand position from this base, None if none is."""
        q = self.solve(x0, b0)
        return None if q is None else Start(x0, b0, q)

    def snap(self, region: Region, start: Start) -> Start | None:
        """Returns the nearest feasible start to where an optimisation ended, None if none is near.

        Base and torso are rounded to the micrometre unless that takes a joint beyond its limit; the
        joint angles follow.
        """
        for b0 in (np.round(start.b0, 6), start.b0):
            x0, b0 = region.clip(start.x0, b0)
            q = self.solve(x0, b0, near=start.q)
            if q is not None:
                return Start(x0, b0, q)
        return None
