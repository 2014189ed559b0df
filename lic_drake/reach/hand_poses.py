"""The hand poses that an arm can take on a start line."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lic_drake.reach.task import StartLine
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class HandPoses:
    """The poses (x, y, phi) of the hand that an arm can take on a start line, in R (Eq. 4).

    A pose is possible when it lies on the line within the line's bounds and the arm reaches it
    within its joint limits. With phi within +-90 degrees the whole last link is then behind the
    line, in the open space outside the clutter.
    """

    arm: Arm
    line: StartLine

    @cached_property
    def grid(self) -> Vector:
        """The discrete starts of the experience library, shape (n, 3), metres and radians."""
        return self.line.grid(self.arm)

    @cached_property
    def lattice(self) -> Vector:
        """A denser set of possible starts, 0.025 m and 7.5 degrees apart, shape (n, 3)."""
        return self.scan(33, 25)

    def scan(self, num_y: int, num_phi: int) -> Vector:
        """Returns the possible poses of a lattice over the line's bounds, shape (n, 3)."""
        y = np.linspace(self.line.lower[1], self.line.upper[1], num_y)
        phi = np.linspace(self.line.lower[2], self.line.upper[2], num_phi)
        poses = [np.array([self.line.x_m, yi, phi_i]) for yi in y for phi_i in phi]
        return np.array([x0 for x0 in poses if len(self.arm.solve_ik(x0))])

    @property
    def y_range(self) -> tuple[float, float]:
        """The ends of the positions for which `phi_range` knows orientations, metres."""
        positions, _ = self._phi_ends
        return float(positions[0]), float(positions[-1])

    def phi_range(self, y: float) -> tuple[Vector, Vector]:
        """Returns the ends (low, high) of the possible orientations at y, and their slopes.

        Interpolated between positions 5 mm apart and kept 1e-3 rad inside.

        Args:
            y: Position on the line within `y_range`, metres.

        Returns:
            The ends, shape (2,), radians, and their derivatives by y, shape (2,), rad/m.
        """
        positions, ends = self._phi_ends
        k = int(np.clip(np.searchsorted(positions, y) - 1, 0, len(positions) - 2))
        slopes = (ends[k + 1] - ends[k]) / (positions[k + 1] - positions[k])
        return ends[k] + slopes * (y - positions[k]), slopes

    @cached_property
    def _phi_ends(self) -> tuple[Vector, Vector]:
        """Positions, shape (n,), and the ends of their longest run of orientations, (n, 2)."""
        line = self.line
        count = max(2, round((line.upper[1] - line.lower[1]) / 0.005) + 1)
        coarse = np.linspace(line.lower[2], line.upper[2], 181)
        positions, ends = [], []
        for y in np.linspace(line.lower[1], line.upper[1], count):
            possible = np.array([self._possible(y, phi) for phi in coarse])
            if not np.any(possible):
                continue
            edges = np.flatnonzero(np.diff(np.concatenate([[False], possible, [False]])))
            runs = edges.reshape(-1, 2)
            first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])] - [0, 1]
            low = coarse[0] if first == 0 else self._edge(y, coarse[first], coarse[first - 1])
            high = coarse[-1] if last == 180 else self._edge(y, coarse[last], coarse[last + 1])
            # A margin for the error of interpolating between positions.
            low, high = low + 1e-3, high - 1e-3
            if low <= high:
                positions.append(y)
                ends.append([low, high])
        return np.array(positions), np.array(ends)

    def _possible(self, y: float, phi: float) -> bool:
        return len(self.arm.solve_ik(np.array([self.line.x_m, y, phi]))) > 0

    def _edge(self, y: float, possible: float, impossible: float) -> float:
        """Returns the last possible orientation on the way to an impossible one."""
        while abs(possible - impossible) > 1e-6:
            middle = 0.5 * (possible + impossible)
            if self._possible(y, middle):
                possible = middle
            else:
                impossible = middle
        return possible

    def contains(self, x0: Vector, tolerance: float = 1e-6) -> bool:
        """Tells whether the arm can start at x0; uses the closed-form inverse kinematics."""
        inside = np.all(x0 >= self.line.lower - tolerance) and np.all(
            x0 <= self.line.upper + tolerance
        )
        return bool(inside) and len(self.arm.solve_ik(x0)) > 0
