import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, PairwiseKernel

from lic_drake.estimate.averaging import average_rows
from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.likelihood import Hyperparameters

PRIOR = Hyperparameters(
    theta=np.array([2.0, 1.0, 3.0, 0.5]),
    signal_variance=0.05,
    noise_floor=0.003,
    reach_variance=0.2,
)


def test_predictions_equal_those_of_scikit_learn(world) -> None:
    library = world.library(environments=3)
    ours = GaussianProcess(hyperparameters=PRIOR).fit(library.Z[::5], library.f[::5])
    rows = average_rows(library.Z[::5], library.f[::5])
    # A constant kernel of large variance is an unknown mean; per-dimension scales are features
    # in other units.
    theirs = GaussianProcessRegressor(
        ConstantKernel(1e4) + ConstantKernel(0.05) * PairwiseKernel(metric="laplacian"),
        alpha=0.2 / rows.count + 0.003,
        optimizer=None,
    ).fit(rows.Z * PRIOR.theta, rows.rate)
    queries = world.library(1).Z[::40] + 0.03
    mean, spread = theirs.predict(queries * PRIOR.theta, return_std=True)
    prediction = ours.predict(queries)
    np.testing.assert_allclose(prediction.probability, np.clip(mean, 0.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(prediction.spread, spread, rtol=1e-4)


@settings(max_examples=50)
@given(st.integers(0, 10_000))
def test_value_and_gradient_agree_with_predict_and_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    Z = rng.uniform(size=(20, 4))
    process = GaussianProcess(hyperparameters=PRIOR).fit(Z, rng.integers(0, 2, 20))
    z = rng.uniform(size=4)
    h = min(1e-5, 0.4 * np.abs(z - Z).min())
    value, gradient = process.value_and_gradient(z)
    numeric = [
        (process.value_and_gradient(z + h * e)[0] - process.value_and_gradient(z - h * e)[0])
        / (2.0 * h)
        for e in np.eye(4)
    ]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-4, atol=1e-5)
    assert np.clip(value, 0.0, 1.0) == pytest.approx(process.predict([z]).probability[0])


def test_averaging_leaves_the_estimate_as_it_is_where_noise_is_that_of_single_reaches(
    world,
) -> None:
    library = world.library(environments=4)
    Z, f = library.Z[::9], library.f[::9]
    Z, f = np.vstack([Z, Z]), np.concatenate([f, 1.0 - f])
    prior = Hyperparameters(
        theta=PRIOR.theta, signal_variance=0.05, noise_floor=0.0, reach_variance=0.2
    )
    averaged = GaussianProcess(hyperparameters=prior).fit(Z, f).predict(Z[:50] + 0.01)
    raw = GaussianProcess(average=False, hyperparameters=prior).fit(Z, f).predict(Z[:50] + 0.01)
    np.testing.assert_allclose(averaged.probability, raw.probability, rtol=1e-8)
    np.testing.assert_allclose(averaged.spread, raw.spread, rtol=1e-6)


def test_the_spread_covers_the_true_probability_as_often_as_it_says(world) -> None:
    library = world.library(environments=8)
    grid = world.grid()
    prediction = GaussianProcess().fit(library.Z, library.f, library.environment).predict(grid)
    error = np.abs(prediction.probability - world.probability(grid)) / prediction.spread
    assert 0.8 < np.mean(error < 1.645) <= 1.0
    assert np.mean(error < 0.5) < 0.7


def test_luck_shared_within_environments_raises_the_noise(flat_world) -> None:
    alike = flat_world.library(environments=8, shared_luck=0.4)
    knowing = GaussianProcess().fit(alike.Z, alike.f, alike.environment)
    unknowing = GaussianProcess().fit(alike.Z, alike.f)
    assert knowing.hyperparameters.reach_variance > unknowing.hyperparameters.reach_variance
    grid = flat_world.grid()
    truth = flat_world.probability(grid)
    error = {
        process: np.mean((process.predict(grid).probability - truth) ** 2)
        for process in (knowing, unknowing)
    }
    assert error[knowing] < error[unknowing]


def test_conditioning_keeps_the_hyperparameters_and_takes_the_rows(scattered) -> None:
    process = GaussianProcess().fit(scattered.Z, scattered.f, scattered.environment)
    part = process.conditioned_on(scattered.Z[:20], scattered.f[:20])
    assert part.hyperparameters is process.hyperparameters
    expected = GaussianProcess(hyperparameters=process.hyperparameters).fit(
        scattered.Z[:20], scattered.f[:20]
    )
    z = scattered.Z[30]
    assert part.value_and_gradient(z)[0] == expected.value_and_gradient(z)[0]
    assert part.value_and_gradient(z)[0] != process.value_and_gradient(z)[0]


@pytest.mark.parametrize("outcome", [0.0, 1.0])
def test_if_every_reach_ends_alike_that_is_the_estimate(world, outcome: float) -> None:
    Z = world.library(environments=2).Z[::11]
    process = GaussianProcess().fit(Z, np.full(len(Z), outcome))
    prediction = process.predict(Z[:5] + 0.05)
    np.testing.assert_allclose(prediction.probability, outcome, atol=1e-6)
    assert np.all(prediction.spread > 0.0)


def test_a_single_row_gives_a_flat_estimate() -> None:
    process = GaussianProcess().fit([[0.5, 0.0, 0.1, 1.0]], [1])
    value, gradient = process.value_and_gradient([0.6, 0.1, 0.0, 0.5])
    assert value == pytest.approx(1.0)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-12)


def test_a_feature_that_never_varies_has_no_influence() -> None:
    rng = np.random.default_rng(0)
    varying = rng.uniform(size=(40, 1))
    f = (varying[:, 0] > 0.5).astype(float)
    process = GaussianProcess().fit(np.column_stack([np.full(40, 0.335), varying]), f)
    low, high = process.predict([[0.335, 0.1], [0.335, 0.9]]).probability
    assert low < 0.3 < 0.7 < high


def test_settings_of_many_rows_come_from_a_part_and_the_estimate_from_all(world) -> None:
    rng = np.random.default_rng(0)
    Z = rng.uniform([0.4, -0.4, -0.4, -1.0], [0.8, 0.4, 0.4, 1.5], (1500, 4))
    f = (rng.random(1500) < world.probability(Z)).astype(float)
    process = GaussianProcess().fit(Z, f, np.arange(1500) // 10)
    expected = GaussianProcess(hyperparameters=process.hyperparameters).fit(Z, f)
    queries = rng.uniform([0.4, -0.4, -0.4, -1.0], [0.8, 0.4, 0.4, 1.5], (200, 4))
    np.testing.assert_array_equal(process.values(queries), expected.values(queries))
    truth = world.probability(queries)
    assert np.mean((process.values(queries) - truth) ** 2) < 0.3 * np.var(truth)


def test_more_rows_than_memory_allows_are_refused() -> None:
    process = GaussianProcess(hyperparameters=PRIOR)
    with pytest.raises(EstimateError, match=r"at most 8000 .* got 8001.*'gp-raw'"):
        process.fit(np.arange(4.0 * 8001).reshape(8001, 4), np.zeros(8001))


def test_asking_before_fitting_says_what_to_do() -> None:
    process = GaussianProcess()
    with pytest.raises(EstimateError, match="call fit"):
        process.predict(np.zeros((1, 4)))
    with pytest.raises(EstimateError, match="call fit"):
        process.value_and_gradient(np.zeros(4))


def test_a_fitted_process_survives_pickling(scattered) -> None:
    process = GaussianProcess(hyperparameters=PRIOR).fit(scattered.Z, scattered.f)
    copy = pickle.loads(pickle.dumps(process))
    z = scattered.Z[0] + 0.01
    assert copy.value_and_gradient(z)[0] == process.value_and_gradient(z)[0]
