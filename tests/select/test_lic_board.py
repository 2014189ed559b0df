"""LIC's selection for a PR2 before a board: by kinematics of its own, samples and known optima."""

from dataclasses import replace

import numpy as np
import pytest
from support.pr2_reference import link_poses
from support.select_surfaces import Bumps

from lic_drake.estimate.features import FeatureMap
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import BoardStarts, board_starts

BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 10}}")
ROLLING = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z", "start_qx"))
"""Features of a hand behind a board that may roll."""


class Ridge(Bumps):
    """Estimates that fall with the distance of the start from a place in the robot's frame."""

    def __init__(self, scale: tuple[float, ...] = (0.0, 0.0, 3.0, 3.0, 0.3)) -> None:
        self.scale = scale
        self.top = np.array([0.0, 0.0, -0.33, 0.8, 0.3])

    def _values(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(-np.abs(X - self.top) @ np.array(self.scale)))

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        value = float(self.values(x[None])[0])
        return value, -value * np.array(self.scale) * np.sign(x - self.top)


RIDGE = SuccessModel(estimator=Ridge(), features=ROLLING)


def before_board(environment: int, *failed: FailedReach) -> Situation:
    instance = BLOCKED.sample_instance("holdout", environment)
    starts = board_starts(BLOCKED, instance, moves=True)
    return Situation(p_WG=BLOCKED.sample_goal("holdout", environment), starts=starts, failed=failed)


@pytest.mark.parametrize("environment", range(3))
def test_a_pr2_points_into_an_open_aperture_and_no_start_of_the_grid_is_better(
    environment: int,
) -> None:
    asked = before_board(environment)
    selector = LicSelector(RIDGE)
    chosen = selector.select(asked)
    x0, b0, q = chosen.start.x0, chosen.start.b0, chosen.start.q
    assert isinstance(asked.starts, BoardStarts) and q is not None
    # By kinematics that do not read the model.
    X_WE = link_poses((b0[0], b0[1], 0.0), b0[2], q)[7]
    np.testing.assert_allclose(X_WE[:3, 3], x0[:3], atol=1e-9)
    np.testing.assert_allclose(X_WE[:3, 0], [1.0, 0.0, 0.0], atol=1e-9)
    assert np.min(np.linalg.norm(asked.starts.p_WA - x0[:3], axis=1)) < 1e-9
    assert not asked.starts.checker.touches(b0, q)
    value = selector.objective(asked).values(Starts.of(chosen.start))[0]
    assert value == pytest.approx(chosen.probability)
    assert value >= selector.objective(asked).values(asked.starts.grid).max() - 1e-8


def test_a_pr2s_selection_is_better_than_random_samples_and_gains_over_the_grid() -> None:
    rng, gains = np.random.default_rng(1), []
    for environment in range(3):
        asked = before_board(environment)
        selector, starts = LicSelector(RIDGE), asked.starts
        chosen = selector.select(asked)
        assert chosen.probability is not None
        objective = selector.objective(asked)
        for _ in range(100):
            region = starts.regions[rng.integers(len(starts.regions))]
            start = starts.nearest(
                np.append(region.lower[:3], [1.0, 0.0, 0.0, 0.0]),
                rng.uniform(region.b0_lower, region.b0_upper),
            )
            if start is not None:
                assert chosen.probability > objective.values(Starts.of(start))[0] - 0.01
        gains.append(chosen.probability - objective.values(starts.grid).max())
    assert max(gains) > 0.02


def test_an_aperture_that_may_be_blocked_counts_less() -> None:
    asked = before_board(1)
    assert isinstance(asked.starts, BoardStarts)
    sure = LicSelector(RIDGE).select(asked)
    at = np.argmin(np.linalg.norm(asked.starts.p_WA - sure.start.x0[:3], axis=1))
    chance = np.where(np.arange(len(asked.starts.p_WA)) == at, 0.1, 1.0)
    starts = replace(asked.starts, probability_open=chance)
    other = LicSelector(RIDGE).select(Situation(p_WG=asked.p_WG, starts=starts))
    assert np.linalg.norm(other.start.x0[:3] - sure.start.x0[:3]) > 0.19
