"""Libraries with a known probability of success, on the grid of the paper's cylinder-clutter."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import load_scenario
from lic_drake.types import Vector

BLANK = {str: "", int: 0, float: 0.0, bool: False, tuple[float, ...]: ()}

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
    Z: Vector
    f: Vector
    environment: NDArray[np.int64]


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

    def probability(self, Z: Vector) -> Vector:
        """Highest where the hand stands to the right of the goal and points at its front."""
        goal_x, goal_y, y, phi = Z.T
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
        f = []
        for _ in range(environments):
            centres, sign = unit[rng.integers(0, len(grid), 10)], rng.choice([-1.0, 1.0], 10)
            distance = np.linalg.norm(unit[:, None] - centres, axis=2)
            luck = shared_luck * np.exp(-0.5 * (distance / 0.8) ** 2) @ sign
            f.append(rng.random(len(grid)) < self.probability(grid) + luck)
        return Library(
            Z=np.tile(grid, (environments, 1)),
            f=np.concatenate(f).astype(float),
            environment=np.repeat(np.arange(environments), len(grid)),
        )


@pytest.fixture(scope="session")
def world() -> World:
    return World()


@pytest.fixture(scope="session")
def flat_world() -> World:
    """With room for luck above and below P(success)."""
    return World(relief=0.3)


@pytest.fixture
def scattered() -> Library:
    """Sixty reaches, no two of the same features, ten in each environment."""
    rng = np.random.default_rng(5)
    Z = rng.uniform([0.4, -0.4, -0.4, -1.0], [0.8, 0.4, 0.4, 1.5], (60, 4))
    f = (rng.random(60) < World().probability(Z)).astype(float)
    return Library(Z=Z, f=f, environment=np.repeat(np.arange(6), 10))


@pytest.fixture
def library(world, tmp_path: Path) -> Path:
    """Every third pair of the grid, in six environments."""
    scenario = load_scenario("cylinder-clutter")
    rows = world.library(environments=6)
    records = []
    for i in range(0, len(rows.f), 3):
        goal_x, goal_y, start_y, start_phi = map(float, rows.Z[i])
        values = {
            "category": "cylinder-clutter",
            "key": f"{i:016x}",
            "scenario": scenario.digest,
            "stream": "training",
            "environment": int(rows.environment[i]),
            "goal_x": goal_x,
            "goal_y": goal_y,
            "start_x": 0.335,
            "start_y": start_y,
            "start_phi": start_phi,
            "success": bool(rows.f[i]),
            "outcome": "reached" if rows.f[i] else "stuck",
        }
        blank = {field.name: BLANK[field.type] for field in dataclasses.fields(ReachRecord)}
        records.append(ReachRecord(**(blank | values)))
    path = tmp_path / "library"
    ExperienceLibrary(path).write_shard("all", records, scenario)
    return path
