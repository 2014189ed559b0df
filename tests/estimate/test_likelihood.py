import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from lic_drake.estimate.averaging import average_rows, reach_variance
from lic_drake.estimate.likelihood import (
    coordinate_distances,
    fit_hyperparameters,
    negative_log_likelihood,
)


def _problem(seed: int, n: int = 12, d: int = 3):
    rng = np.random.default_rng(seed)
    Z, y = rng.normal(size=(n, d)), rng.random(n)
    noise = rng.uniform(0.01, 0.2, n)
    log_parameters = rng.uniform(-2.0, 1.0, d + 2)
    return log_parameters, coordinate_distances(Z), y, noise


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
    h = 1e-5
    numeric = [
        (
            negative_log_likelihood(log_parameters + h * e, *data)[0]
            - negative_log_likelihood(log_parameters - h * e, *data)[0]
        )
        / (2.0 * h)
        for e in np.eye(len(log_parameters))
    ]
    np.testing.assert_allclose(gradient, numeric, rtol=1e-5, atol=1e-6)


def test_the_search_finds_parameters_about_as_likely_as_the_true_ones_or_more() -> None:
    rng = np.random.default_rng(3)
    Z = rng.uniform(size=(150, 2))
    theta, signal, floor, noise = np.array([6.0, 1.0]), 0.05, 0.002, np.full(150, 0.005)
    distances = coordinate_distances(Z)
    covariance = signal * np.exp(-np.tensordot(theta, distances, axes=1))
    covariance += np.diag(noise + floor)
    y = 0.6 + np.linalg.cholesky(covariance) @ rng.standard_normal(150)
    found = fit_hyperparameters(Z, y, count=np.ones(150), reach_variance=0.005)

    def misfit(theta, signal, floor) -> float:
        return negative_log_likelihood(np.log([*theta, signal, floor]), distances, y, noise)[0]

    assert misfit(found.theta, found.signal_variance, found.noise_floor) <= misfit(
        theta, signal, floor
    )
    assert found.theta[0] > 2.0 * found.theta[1]


def test_scales_follow_the_units_of_the_features(world) -> None:
    library = world.library(environments=4)
    rows = average_rows(library.Z[::7], library.f[::7])
    unit = np.array([1.0, 100.0, 1e-3, 57.3])
    variance = reach_variance(rows)
    in_metres = fit_hyperparameters(rows.Z, rows.rate, rows.count, variance)
    in_others = fit_hyperparameters(rows.Z * unit, rows.rate, rows.count, variance)
    np.testing.assert_allclose(in_others.theta * unit, in_metres.theta, rtol=1e-3)
