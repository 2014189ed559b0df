"""`Region`: a box of hand poses and bases, one part of where a reach may start (Eq. 4)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.types import IntVector, Vector

TOLERANCE = 1e-6
"""A hand or a base this near to the bounds, in metres or radians, counts as inside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Region:
    """A box of x0 and b0; joint limits and collisions apart, all of it is feasible.

    Attributes:
        lower: Lower bounds of x0 in W, shape (3,), or in space (7,), metres and radians.
        upper: Upper bounds of x0.
        b0_lower: Lower bounds of b0, shape (3,), metres.
        b0_upper: Upper bounds of b0, shape (3,), metres.
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

        In space the hand points along Wx and may only turn about it; in the plane the angles phi
        are those between the bounds.
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
