import numpy as np
import pytest

from lic_drake.estimate.features import PLANAR_LIC1
from scripts.unknown_category.final_position import OUTLIERS, FinalPositions

Columns = dict[str, np.ndarray]


def failures(count: int = 600, spread: float = 0.05, seed: int = 0, base_y: float = 0.0) -> Columns:
    """Reaches of which every other one fails, near a point that depends on where it started."""
    rng = np.random.default_rng(seed)
    start_y = rng.uniform(-0.4, 0.4, count)
    return {
        "goal_x": np.full(count, 0.7),
        "goal_y": rng.uniform(-0.2, 0.2, count) + base_y,
        "start_y": start_y + base_y,
        "start_phi": rng.uniform(-1.0, 1.0, count),
        "base_y": np.full(count, base_y),
        "base_x": np.zeros(count),
        "success": np.arange(count) % 2 == 1,
        "stream": np.full(count, "training"),
        "environment": np.arange(count) // 10,
        "final_x": 0.5 + spread * rng.standard_normal(count),
        "final_y": 0.5 * start_y + base_y + spread * rng.standard_normal(count),
    }


def test_it_is_a_density_over_the_plane() -> None:
    final = FinalPositions.fit(PLANAR_LIC1, failures(100))
    step = 0.025
    x, y = np.meshgrid(np.arange(-1.0, 2.0, step), np.arange(-1.5, 1.5, step))
    z = [0.7, 0.0, 0.2, 0.0]
    density = np.exp(final.log_density(z, np.column_stack([x.ravel(), y.ravel()])))
    # The share of outliers has the density of one square metre everywhere.
    assert np.sum(density - OUTLIERS) * step**2 == pytest.approx(1.0 - OUTLIERS, abs=1e-3)


def test_it_comes_near_the_density_that_the_failures_were_drawn_from() -> None:
    spread = 0.05
    final = FinalPositions.fit(PLANAR_LIC1, failures(2000, spread))
    unseen = failures(200, spread, seed=1)
    rows = PLANAR_LIC1.rows(unseen)
    ours, truth = [], []
    for z, x, y, start_y in zip(
        rows.X, unseen["final_x"], unseen["final_y"], unseen["start_y"], strict=True
    ):
        ours.append(final.log_density(z, [[x, y]])[0])
        squared = ((x - 0.5) ** 2 + (y - 0.5 * start_y) ** 2) / spread**2
        truth.append(-0.5 * squared - np.log(2.0 * np.pi * spread**2))
    # What is lost on the average is the Kullback-Leibler divergence; a density that knows nothing
    # of the start loses more.
    assert 0.0 < np.mean(truth) - np.mean(ours) < 0.4
    everywhere = np.log(1.0 / (2.0 * np.pi * spread * np.hypot(spread, 0.5 * 0.8 / 12**0.5)))
    assert np.mean(ours) > everywhere - 1.0 + 0.3


def test_a_base_carries_all_of_it() -> None:
    here = FinalPositions.fit(PLANAR_LIC1, failures(100))
    there = FinalPositions.fit(PLANAR_LIC1, failures(100, base_y=0.3))
    z, p_RE = [0.7, 0.1, 0.1, 0.3], [[0.5, 0.1]]
    assert there.log_density(z, p_RE) == pytest.approx(here.log_density(z, p_RE), abs=1e-9)
