from dataclasses import replace

import numpy as np
import pytest

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.linear_map import (
    MappedEstimator,
    can_be_relative,
    features_apart,
    relative_features,
)
from lic_drake.estimate.nearest_neighbours import NearestNeighbours
from lic_drake.estimate.registry import make_estimator

FEATURES = features_of("sphere-aperture-clutter")
RNG = np.random.default_rng(3)
Z = RNG.uniform(-0.5, 0.5, (200, 5))
F = (np.abs(Z[:, 2] - Z[:, 0]) < 0.2).astype(float)


def test_features_are_relative_to_the_goal() -> None:
    z = dict(goal_y=1.0, goal_z=2.0, start_y=10.0, start_z=20.0, start_qx=7.0)
    given = np.array([z[name] for name in FEATURES.first.names])
    matrix = relative_features(FEATURES.first)
    np.testing.assert_array_equal(matrix @ given, [9.0, 18.0, 10.0, 20.0])
    z |= dict(first_start_y=100.0, first_start_z=300.0)
    given = np.array([z[name] for name in FEATURES.second.names])
    apart = features_apart(FEATURES.second, "start", "first_start")
    np.testing.assert_array_equal(apart @ given, [-90.0, -280.0])


def test_other_features_are_left_as_they_are() -> None:
    assert can_be_relative(FEATURES.first) and can_be_relative(FEATURES.second)
    assert not can_be_relative(PLANAR_LIC1)
    assert not can_be_relative(replace(FEATURES.first, start=("start_y", "start_qx")))


def test_estimates_are_those_of_the_other_estimator() -> None:
    matrix = relative_features(FEATURES.first)
    mapped = MappedEstimator(GaussianProcess(), matrix).fit(Z, F)
    other = GaussianProcess().fit(np.round(Z @ matrix.T, 9), F)
    np.testing.assert_allclose(mapped.values(Z[:20]), other.values(Z[:20] @ matrix.T), atol=1e-6)
    found = mapped.predict(Z[:20]).probability
    np.testing.assert_allclose(found, np.clip(mapped.values(Z[:20]), 0.0, 1.0))


@pytest.mark.parametrize("name", ["gp", "knn"])
def test_the_gradient_is_that_of_the_estimate(name: str) -> None:
    estimator = make_estimator(name, FEATURES.first).fit(Z, F)
    z, step = Z[7] + 0.013, 1e-6
    value, gradient = estimator.value_and_gradient(z)
    assert value == pytest.approx(float(estimator.values(z[None])[0]), abs=1e-12)
    steps = step * np.eye(5)
    numeric = (estimator.values(z + steps) - estimator.values(z - steps)) / (2.0 * step)
    np.testing.assert_allclose(gradient, numeric, atol=1e-3)


def test_equal_differences_are_one_feature() -> None:
    # 0.3 - 0.1 and 0.4 - 0.2 differ in the last digit.
    rows = np.array([[0.1, 0.0, 0.3, 0.0, 0.0], [0.2, 0.0, 0.4, 0.0, 0.0]])
    mapped = MappedEstimator(GaussianProcess(), relative_features(FEATURES.first))._map(rows)
    np.testing.assert_array_equal(mapped[0, :2], mapped[1, :2])


def test_neighbours_reach_beyond_the_pairs_that_every_environment_repeats() -> None:
    """With environments held out the other copies of a pair would tell all there is to know."""
    rng = np.random.default_rng(8)
    rows = rng.uniform(-0.5, 0.5, (300, 5))
    rows[:, :2] = np.round(rows[:, :2], 1)
    won = (np.abs(rows[:, 2] - rows[:, 0]) < 0.2).astype(float)
    Z_all, f_all = np.tile(rows, (6, 1)), np.tile(won, 6)
    environment = np.repeat(np.arange(6), len(rows))
    matrix = relative_features(FEATURES.first)
    by_environment = MappedEstimator(NearestNeighbours(), matrix).fit(Z_all, f_all, environment)
    by_situation = make_estimator("knn", FEATURES.first).fit(Z_all, f_all, environment)
    new = rng.uniform(-0.5, 0.5, (2000, 5))
    truth = np.abs(new[:, 2] - new[:, 0]) < 0.2
    loss = [np.mean((e.values(new) - truth) ** 2) for e in (by_environment, by_situation)]
    assert loss[1] < 0.9 * loss[0]


def test_further_rows_are_handed_on() -> None:
    matrix = relative_features(FEATURES.first)
    mapped = MappedEstimator(GaussianProcess(), matrix).fit(Z[:150], F[:150])
    other = GaussianProcess().fit(np.round(Z[:150] @ matrix.T, 9), F[:150])
    mapped.update(Z[150:], F[150:], 2.0)
    other.update(np.round(Z[150:] @ matrix.T, 9), F[150:], 2.0)
    np.testing.assert_allclose(mapped.values(Z[:20]), other.values(Z[:20] @ matrix.T), atol=1e-6)
