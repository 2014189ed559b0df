"""Libraries with a known probability of success, on the grid of the paper's cylinder-clutter."""

from dataclasses import dataclass

import numpy as np

from lic_drake.types import IntVector, Vector

GOALS = [(x, y) for x in (0.4, 0.5, 0.6, 0.7, 0.8) for y in np.linspace(-0.4, 0.4, 9).round(9)]
# Position of the hand, metres: orientations in degrees. The 21 that the joint limits leave.
STARTS = {
    -0.4: (-30, 0),
    -0.3: (-30, 0, 30),
    -0.2: (0, 30, 60),
    -0.1: (30, 60, 90),
    0.0: (30, 60, 90),
    0.1: (60, 90),
    0.2: (60, 90),
    0.3: (60, 90),
    0.4: (90,),
}


@dataclass(frozen=True)
class Library:
    X: Vector
    y: Vector
    groups: IntVector


@dataclass(frozen=True)
class World:
    """A smooth P(success), and reaches drawn from it.

    Attributes:
        relief: 0: P(success) is 1/2 everywhere; 1: it is as different as can be.
    """

    relief: float = 1.0

    def grid(self) -> Vector:
        """The 45 x 21 distinct feature vectors."""
        return np.array(
            [
                (x, y, start_y, np.deg2rad(phi))
                for x, y in GOALS
                for start_y, phis in STARTS.items()
                for phi in phis
            ]
        )

    def probability(self, X: Vector) -> Vector:
        """Highest where the hand stands to the right of the goal and points at its front."""
        goal_x, goal_y, y, phi = X.T
        best_y = 0.7 * goal_y - 0.2
        best_phi = 0.7 + 1.2 * y - 0.5 * goal_y
        miss = ((y - best_y) / 0.25) ** 2 + ((phi - best_phi) / 0.6) ** 2
        p = 0.2 + (0.95 - 0.5 * goal_x) * np.exp(-0.5 * miss)
        return 0.5 + self.relief * (p - 0.5)

    def library(self, environments: int, seed: int = 0, shared_luck: float = 0.0) -> Library:
        """Every pair once in each environment.

        Args:
            environments: Number of them.
            seed: Of the draws.
            shared_luck: Height of bumps, ten at random pairs of each environment, by which
                P(success) rises or falls for all pairs around, as a cylinder in the way would.
        """
        rng = np.random.default_rng(seed)
        grid = self.grid()
        unit = grid / grid.std(axis=0)
        y = []
        for _ in range(environments):
            centres, sign = unit[rng.integers(0, len(grid), 10)], rng.choice([-1.0, 1.0], 10)
            distance = np.linalg.norm(unit[:, None] - centres, axis=2)
            luck = shared_luck * np.exp(-0.5 * (distance / 0.8) ** 2) @ sign
            y.append(rng.random(len(grid)) < self.probability(grid) + luck)
        return Library(
            X=np.tile(grid, (environments, 1)),
            y=np.concatenate(y).astype(float),
            groups=np.repeat(np.arange(environments), len(grid)),
        )


def scattered_library() -> Library:
    """Sixty reaches, no two of the same features, ten in each environment."""
    rng = np.random.default_rng(5)
    X = rng.uniform([0.4, -0.4, -0.4, -1.0], [0.8, 0.4, 0.4, 1.5], (60, 4))
    y = (rng.random(60) < World().probability(X)).astype(float)
    return Library(X=X, y=y, groups=np.repeat(np.arange(6), 10))
