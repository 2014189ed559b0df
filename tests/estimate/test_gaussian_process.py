import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, PairwiseKernel

from lic_drake.errors import EstimateError
from lic_drake.estimate.gaussian_process import (
    GaussianProcess,
    Hyperparameters,
    fit_hyperparameters,
    negative_log_likelihood,
)
from lic_drake.estimate.rows import AveragedRows, average_rows

PRIOR = Hyperparameters(
    theta=np.array([2.0, 1.0, 3.0, 0.5]),
    signal_variance=0.05,
    noise_floor=0.003,
    reach_variance=0.2,
)


@pytest.mark.parametrize("weighted", [False, True])
def test_values_equal_those_of_scikit_learn(world, weighted: bool) -> None:
    library = world.library(environments=3)
    X, y = library.X[::5], library.y[::5]
    weight = np.linspace(0.5, 20.0, len(y)) if weighted else None
    ours = GaussianProcess(PRIOR).fit(X, y, sample_weight=weight)
    rows = average_rows(X, y, weight)
    # A constant kernel of large variance is an unknown mean; per-dimension scales are features
    # in other units.
    theirs = GaussianProcessRegressor(
        ConstantKernel(1e4) + ConstantKernel(0.05) * PairwiseKernel(metric="laplacian"),
        alpha=0.2 / rows.count + 0.003,
        optimizer=None,
    ).fit(rows.X * PRIOR.theta, rows.rate)
    queries = world.grid()[::40] + 0.03
    np.testing.assert_allclose(
        ours.values(queries), theirs.predict(queries * PRIOR.theta), atol=1e-6
    )


@settings(max_examples=50)
@given(st.integers(0, 10_000))
def test_value_and_gradient_agree_with_values_and_finite_differences(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(20, 4))
    process = GaussianProcess(PRIOR).fit(X, rng.integers(0, 2, 20))
    x = rng.uniform(size=4)
    h = min(1e-5, 0.4 * np.abs(x - X).min())
    value, gradient = process.value_and_gradient(x)
    up, down = process.values(x + h * np.eye(4)), process.values(x - h * np.eye(4))
    np.testing.assert_allclose(gradient, (up - down) / (2.0 * h), rtol=1e-4, atol=1e-5)
    assert value == pytest.approx(process.values([x])[0])


def test_at_a_kink_the_gradient_is_the_mean_of_both_sides(scattered) -> None:
    process = GaussianProcess(PRIOR).fit(scattered.X, scattered.y)
    x, h = scattered.X[4], 1e-7 * np.eye(4)
    at, up, down = (process.values(points) for points in (np.tile(x, (4, 1)), x + h, x - h))
    sides = (up - at) / 1e-7, (at - down) / 1e-7
    assert np.abs(sides[0] - sides[1]).max() > 0.01
    gradient = process.value_and_gradient(x)[1]
    np.testing.assert_allclose(gradient, np.mean(sides, axis=0), atol=1e-5)


def test_more_rows_than_memory_allows_are_refused() -> None:
    with pytest.raises(EstimateError, match=r"at most 8000 .* got 8001.*'knn'"):
        GaussianProcess(PRIOR).fit(np.arange(4.0 * 8001).reshape(8001, 4), np.zeros(8001))


def distances_of(X):
    return np.abs(X.T[:, :, None] - X.T[:, None, :])


def _problem(seed: int, n: int = 12, d: int = 3):
    rng = np.random.default_rng(seed)
    X, y = rng.normal(size=(n, d)), rng.random(n)
    noise = rng.uniform(0.01, 0.2, n)
    log_parameters = rng.uniform(-2.0, 1.0, d + 2)
    return log_parameters, distances_of(X), y, noise


def test_the_likelihood_is_that_of_a_multivariate_normal_at_its_best_mean() -> None:
    log_parameters, distances, y, noise = _problem(1)
    *theta, signal, floor = np.exp(log_parameters)
    covariance = signal * np.exp(-sum(t * D for t, D in zip(theta, distances, strict=True)))
    covariance += np.diag(noise + floor)
    densities = [
        multivariate_normal(np.full(len(y), mu), covariance).logpdf(y)
        for mu in np.linspace(-1.0, 2.0, 3001)
    ]
    constant = 0.5 * len(y) * np.log(2.0 * np.pi)
    value, _ = negative_log_likelihood(log_parameters, distances, y, noise)
    assert value == pytest.approx(-max(densities) - constant, abs=1e-4)


@settings(max_examples=30)
@given(st.integers(0, 10_000))
def test_its_gradient_equals_finite_differences(seed: int) -> None:
    log_parameters, *data = _problem(seed)
    _, gradient = negative_log_likelihood(log_parameters, *data)
    at = log_parameters + 1e-5 * np.vstack([np.eye(5), -np.eye(5)])
    up, down = np.split(np.array([negative_log_likelihood(p, *data)[0] for p in at]), 2)
    np.testing.assert_allclose(gradient, (up - down) / 2e-5, rtol=1e-5, atol=1e-6)


def test_the_search_finds_parameters_about_as_likely_as_the_true_ones_or_more() -> None:
    rng = np.random.default_rng(3)
    X = rng.uniform(size=(150, 2))
    theta, signal, floor, noise = np.array([6.0, 1.0]), 0.05, 0.002, np.full(150, 0.005)
    distances = distances_of(X)
    covariance = signal * np.exp(-np.tensordot(theta, distances, axes=1))
    covariance += np.diag(noise + floor)
    y = 0.6 + np.linalg.cholesky(covariance) @ rng.standard_normal(150)
    rows = AveragedRows(X=X, rate=y, count=np.ones(150), member=np.arange(150))
    found = fit_hyperparameters(rows, reach_variance=0.005)

    def misfit(theta, signal, floor) -> float:
        return negative_log_likelihood(np.log([*theta, signal, floor]), distances, y, noise)[0]

    assert misfit(found.theta, found.signal_variance, found.noise_floor) <= misfit(
        theta, signal, floor
    )
    assert found.theta[0] > 2.0 * found.theta[1]
