"""Estimators that go on learning: what they become, against learning everything at once."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, PairwiseKernel

from lic_drake.estimate.averaging import AveragedRows, average_rows
from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.estimator import UpdatableEstimator
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.likelihood import Hyperparameters
from lic_drake.estimate.local import LocalEstimator
from lic_drake.estimate.nearest_neighbours import NearestNeighbours
from lic_drake.estimate.posterior import condition
from lic_drake.estimate.registry import estimator_names, make_estimator

PRIOR = Hyperparameters(
    theta=np.array([2.0, 1.0, 3.0, 0.5]),
    signal_variance=0.05,
    noise_floor=0.003,
    reach_variance=0.2,
)
LIC2 = FeatureMap(goal=PLANAR_LIC1.goal, start=PLANAR_LIC1.start, observed=("first_start_y",))


def draw(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows of which some have equal features."""
    Z = rng.uniform(size=(count, 4)).round(1)
    return Z, rng.integers(0, 2, count).astype(float)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.01, 100.0))
def test_an_updated_process_is_the_one_that_saw_all_rows_at_once(seed: int, weight: float) -> None:
    rng = np.random.default_rng(seed)
    batches = [draw(rng, 40), draw(rng, 15), draw(rng, 25)]
    process = GaussianProcess(hyperparameters=PRIOR).fit(*batches[0])
    for Z, f in batches[1:]:
        process.update(Z, f, weight)
    rows = [
        average_rows(Z, f, np.full(len(f), w))
        for (Z, f), w in zip(batches, (1, weight, weight), strict=True)
    ]
    whole = condition(
        AveragedRows(
            Z=np.vstack([r.Z for r in rows]),
            rate=np.concatenate([r.rate for r in rows]),
            count=np.concatenate([r.count for r in rows]),
            member=np.zeros(0, dtype=np.intp),
        ),
        PRIOR,
    )
    queries = rng.uniform(size=(20, 4))
    np.testing.assert_allclose(process.values(queries), whole.mean(queries), rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        process.predict(queries).spread, whole.standard_deviation(queries), rtol=0, atol=1e-9
    )
    value, gradient = process.value_and_gradient(queries[0])
    expected, slope = whole.mean_and_gradient(queries[0])
    assert value == pytest.approx(expected, abs=1e-9)
    np.testing.assert_allclose(gradient, slope, atol=1e-8)


def test_a_weight_divides_the_noise_as_scikit_learn_has_it(world) -> None:
    library = world.library(environments=1)
    Z, f = library.Z[::9], library.f[::9]
    old, new = slice(0, 60), slice(60, None)
    weight = np.linspace(0.5, 20.0, len(f) - 60)
    ours = GaussianProcess(hyperparameters=PRIOR).fit(Z[old], f[old])
    ours.update(Z[new], f[new], weight)
    alpha = 0.2 / np.concatenate([np.ones(60), weight]) + 0.003
    theirs = GaussianProcessRegressor(
        ConstantKernel(1e4) + ConstantKernel(0.05) * PairwiseKernel(metric="laplacian"),
        alpha=alpha,
        optimizer=None,
    ).fit(Z * PRIOR.theta, f)
    queries = world.grid()[::40] + 0.03
    np.testing.assert_allclose(
        ours.values(queries), theirs.predict(queries * PRIOR.theta), atol=1e-6
    )


def test_hyperparameters_stay_as_the_library_taught_them(world) -> None:
    library = world.library(environments=2)
    process = GaussianProcess().fit(library.Z, library.f, library.environment)
    before = process.hyperparameters
    process.update(library.Z[:200] + 0.01, 1.0 - library.f[:200], 4.0)
    assert process.hyperparameters is before


@pytest.mark.parametrize("name", ["gp", "knn"])
@pytest.mark.parametrize("features", [PLANAR_LIC1, LIC2], ids=["LIC-1", "LIC-2"])
def test_a_heavy_contradiction_turns_every_estimate_and_a_light_one_does_not(
    name: str, features: FeatureMap
) -> None:
    rng = np.random.default_rng(3)
    Z = rng.uniform(size=(120, len(features.names)))
    # The simulation says "to the left"; reality says "to the right".
    f = (Z[:, 0] < 0.5).astype(float)
    queries = Z[(Z[:, 0] < 0.25) | (Z[:, 0] > 0.75)]
    left = queries[:, 0] < 0.5
    estimates = {}
    for weight in (0.01, 100.0):
        estimator = make_estimator(name, features).fit(Z, f, np.arange(120) // 10)
        estimator.update(Z + 1e-3, 1.0 - f, weight)
        estimates[weight] = estimator.predict(queries).probability
    assert estimates[0.01][left].mean() > 0.6 > 0.4 > estimates[0.01][~left].mean()
    assert estimates[100.0][left].mean() < 0.4 < 0.6 < estimates[100.0][~left].mean()


@pytest.mark.parametrize("name", estimator_names())
def test_our_estimators_can_all_be_updated(name: str) -> None:
    assert isinstance(make_estimator(name), UpdatableEstimator)


def test_updated_neighbours_are_those_of_all_rows_with_the_same_bandwidths() -> None:
    rng = np.random.default_rng(1)
    (Z, f), (more_Z, more_f) = draw(rng, 60), draw(rng, 40)
    weight = rng.uniform(0.1, 5.0, 40)
    bandwidth = np.array([0.1, 0.2, 0.3, 0.4])
    updated = NearestNeighbours(neighbours=500, bandwidth=bandwidth).fit(Z, f)
    updated.update(more_Z, more_f, weight)
    queries = rng.uniform(size=(30, 4))
    everything, success = np.vstack([Z, more_Z]), np.concatenate([f, more_f])
    distance = (queries[:, None] - everything) / bandwidth
    kernel = np.exp(-0.5 * np.sum(distance**2, axis=2)) * np.concatenate([np.ones(60), weight])
    np.testing.assert_allclose(updated.values(queries), kernel @ success / kernel.sum(axis=1))


def test_an_updated_local_model_is_the_one_of_all_rows(scattered) -> None:
    prior = GaussianProcess(hyperparameters=PRIOR)
    local = LocalEstimator(lambda near: prior, slice(0, 2), size=1000)
    local.fit(scattered.Z[:40], scattered.f[:40], scattered.environment[:40])
    local.values(scattered.Z)  # What it remembers of the old rows must not stay.
    local.update(scattered.Z[40:], scattered.f[40:], 3.0)
    whole = GaussianProcess(hyperparameters=PRIOR).conditioned_on(
        scattered.Z, scattered.f, np.repeat([1.0, 3.0], [40, 20])
    )
    queries = scattered.Z + 0.01
    np.testing.assert_allclose(local.values(queries), whole.values(queries), atol=1e-10)


def test_an_update_is_much_quicker_than_a_fit(world) -> None:
    library = world.library(environments=3)
    began = time.process_time()
    process = GaussianProcess().fit(library.Z, library.f, library.environment)
    fitted = time.process_time()
    process.update(library.Z[:100] + 0.01, library.f[:100])
    updated = time.process_time()
    assert updated - fitted < 0.2 * (fitted - began)


@pytest.mark.parametrize("name", estimator_names())
def test_what_cannot_be_taken_in_is_refused_and_changes_nothing(name: str, scattered) -> None:
    estimator = make_estimator(name)
    with pytest.raises(EstimateError, match="fit"):
        estimator.update(scattered.Z, scattered.f)
    estimator.fit(scattered.Z, scattered.f, scattered.environment)
    before = estimator.values(scattered.Z)
    for Z, f, weight, said in (
        (scattered.Z, scattered.f, 0.0, "positive"),
        (scattered.Z, scattered.f, np.inf, "positive"),
        (scattered.Z, scattered.f, np.ones(3), "one for each of 60 rows"),
        (scattered.Z[:, :3], scattered.f, 1.0, r"shape \(n, 4\)"),
        (scattered.Z, scattered.f + 0.5, 1.0, "0 or 1"),
    ):
        with pytest.raises(EstimateError, match=said):
            estimator.update(Z, f, weight)
    np.testing.assert_array_equal(estimator.values(scattered.Z), before)


def test_a_process_refuses_to_grow_beyond_what_memory_holds(scattered) -> None:
    process = GaussianProcess(hyperparameters=PRIOR).fit(scattered.Z, scattered.f)
    Z = np.random.default_rng(0).uniform(size=(7990, 4))
    with pytest.raises(EstimateError, match="at most 8000 distinct rows, got 8050"):
        process.update(Z, np.zeros(7990))
