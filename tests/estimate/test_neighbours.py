from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.neighbors import KNeighborsRegressor

from lic_drake.errors import EstimateError
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters
from lic_drake.estimate.neighbours import LocalEstimator, NearestNeighbours, choose_process

BANDWIDTH = np.array([0.08, 0.15, 0.1, 0.4])  # Of the four features of cylinder-clutter.
SITUATION = slice(0, 2)
PRIOR = Hyperparameters(
    theta=np.full(4, 2.0), signal_variance=0.05, noise_floor=1e-3, reach_variance=0.2
)
GIVEN: list[tuple[np.ndarray, np.ndarray]] = []


def _gaussian(distance):
    return np.exp(-0.5 * distance**2)


@pytest.mark.parametrize("neighbours", [1, 7, 60, 500])
def test_values_equal_those_of_scikit_learn_on_distinct_rows(scattered, neighbours) -> None:
    theirs = KNeighborsRegressor(min(neighbours, 60), weights=_gaussian).fit(
        scattered.X / BANDWIDTH, scattered.y
    )
    ours = NearestNeighbours(neighbours, BANDWIDTH).fit(scattered.X, scattered.y)
    queries = scattered.X[:20] + 0.02
    expected = theirs.predict(queries / BANDWIDTH)
    np.testing.assert_allclose(ours.values(queries), expected, rtol=1e-9, atol=1e-12)


def test_conditioning_keeps_bandwidths_and_weights_multiply_the_kernel(scattered) -> None:
    ours = NearestNeighbours(500).fit(scattered.X[:40], scattered.y[:40], scattered.groups[:40])
    weight = np.linspace(0.1, 5.0, 60)
    other = ours.conditioned_on(scattered.X, scattered.y, weight)
    np.testing.assert_array_equal(other.bandwidth_, ours.bandwidth_)
    queries = scattered.X[:20] + 0.02
    distance = np.linalg.norm((queries[:, None] - scattered.X) / ours.bandwidth_, axis=2)
    kernel = _gaussian(distance) * weight
    np.testing.assert_allclose(other.values(queries), kernel @ scattered.y / kernel.sum(axis=1))


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.sampled_from([5, 100]))
def test_the_gradient_equals_finite_differences(seed: int, neighbours: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(size=(30, 3)) * [1.0, 10.0, 0.1]
    scale = np.array([0.3, 2.0, 0.02])
    ours = NearestNeighbours(neighbours, scale).fit(X, rng.integers(0, 2, 30))
    x = rng.uniform(size=3) * [1.0, 10.0, 0.1]
    value, gradient = ours.value_and_gradient(x)
    distances = np.sort(np.linalg.norm((X - x) / scale, axis=1))
    if neighbours < 30 and distances[neighbours] - distances[neighbours - 1] < 1e-4:
        return  # The set of neighbours changes within the difference.
    h = 1e-6 * np.diag(scale)
    numeric = (ours.values(x + h) - ours.values(x - h)) / 2e-6
    np.testing.assert_allclose(gradient * scale, numeric, rtol=1e-4, atol=1e-6)
    assert value == pytest.approx(ours.values([x])[0], abs=1e-12)


def test_each_feature_gets_its_own_bandwidth_in_its_unit() -> None:
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(2000, 3)) * [1.0, 100.0, 1.0]
    X[:, 2] = 0.335  # Always the same: no search along it.
    y = rng.random(2000) < 0.5 + 0.45 * np.sign(np.sin(40.0 * X[:, 0]))
    bandwidth = NearestNeighbours().fit(X, y, np.arange(2000) % 10).bandwidth_
    assert bandwidth[0] < 0.1  # A half wave is 0.08 long.
    assert bandwidth[1] > 50.0  # Tells nothing.


def test_holding_out_goals_reaches_beyond_the_pairs_that_every_environment_repeats() -> None:
    """With environments held out the other copies of a pair would tell all there is to know."""
    rng = np.random.default_rng(8)
    rows = rng.uniform(-0.5, 0.5, (300, 4))
    rows[:, 0] = rows[:, 2] - np.round(rows[:, 2] - rows[:, 0], 1)  # Starts from ten goals.
    won = (np.abs(rows[:, 0]) < 0.2).astype(float)
    X, y, groups = np.tile(rows, (6, 1)), np.tile(won, 6), np.repeat(np.arange(6), 300)
    by_environment = NearestNeighbours().fit(X, y, groups)
    by_goal = NearestNeighbours(held_out=[[-1.0, 0.0, 1.0, 0.0]]).fit(X, y, groups)
    new = rng.uniform(-0.5, 0.5, (2000, 4))
    truth = np.abs(new[:, 0]) < 0.2
    loss = [np.mean((e.values(new) - truth) ** 2) for e in (by_environment, by_goal)]
    assert loss[1] < 0.9 * loss[0]


@pytest.mark.parametrize("settings", [{"neighbours": 0}, {"bandwidth": [0.1, 0.0]}])
def test_settings_that_make_no_sense_are_refused(settings) -> None:
    with pytest.raises(EstimateError, match="positive bandwidths"):
        NearestNeighbours(**settings).fit([[0.5, 1.0]], [1])


# Local models


class CountingProcess(GaussianProcess):
    """Notes the rows that are given to any of its clones."""

    def _fit(self, X, y, groups, weight) -> None:
        GIVEN.append((X, y))
        super()._fit(X, y, groups, weight)


def local_process(size: int) -> LocalEstimator:
    GIVEN.clear()
    return LocalEstimator(lambda local: CountingProcess(PRIOR), SITUATION, size)


def test_the_local_model_is_the_one_given_the_rows_of_the_nearest_situations(world) -> None:
    library = world.library(environments=3)
    local = local_process(2 * 63).fit(library.X, library.y, library.groups)
    queries = np.array([[0.512, -0.213, 0.1, 1.2], [0.512, -0.213, -0.3, 0.2]])
    values = local.values(queries)
    value, gradient = local.value_and_gradient(queries[0])
    assert len(GIVEN) == 1  # All starts of a situation share a model.

    scale = local.length_scale_[:2]
    centre = scale * 0.5 * np.round(queries[0, :2] / scale / 0.5)
    distance = np.linalg.norm((library.X[:, :2] - centre) / scale, axis=1)
    near = distance < np.sort(np.unique(distance.round(9)))[2] - 1e-6
    assert near.sum() == 2 * 63
    expected = GaussianProcess(PRIOR).fit(library.X[near], library.y[near])
    np.testing.assert_allclose(values, expected.values(queries))
    assert value == pytest.approx(expected.value_and_gradient(queries[0])[0])
    np.testing.assert_allclose(gradient, expected.value_and_gradient(queries[0])[1])


def test_models_are_shared_by_half_a_length_scale(world) -> None:
    library = world.library(environments=1)
    local = local_process(100).fit(library.X, library.y)
    X = np.column_stack([np.full(1000, 0.5), np.linspace(-0.4, 0.4, 1000), np.zeros((1000, 2))])
    local.values(X)
    assert 2 < len(GIVEN) <= 3 + 0.8 / (0.5 * local.length_scale_[1])


def test_rows_are_nearest_in_the_features_that_matter() -> None:
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(3000, 4))
    y = rng.random(3000) < 0.5 + 0.45 * np.sign(X[:, 0] - 0.5)
    local_process(100).fit(X, y, np.arange(3000) // 10).values([[0.5, 0.5, 0.0, 0.0]])
    spread = np.std(GIVEN[0][0], axis=0)
    assert len(GIVEN[0][0]) == 100
    assert spread[0] < 0.5 * spread[1]


def test_a_library_below_the_size_is_used_as_a_whole_with_its_weights(scattered) -> None:
    weight = np.repeat([1.0, 3.0], [40, 20])
    local = local_process(60).fit(scattered.X, scattered.y, scattered.groups, weight)
    whole = GaussianProcess(PRIOR).fit(scattered.X, scattered.y, sample_weight=weight)
    np.testing.assert_allclose(local.values(scattered.X + 0.01), whole.values(scattered.X + 0.01))
    with pytest.raises(EstimateError, match="size 1"):
        local_process(1).fit(scattered.X, scattered.y)


def test_rows_at_equal_distance_come_from_all_environments(world) -> None:
    library = world.library(environments=8)
    # Marks each environment by a feature that neither distance nor estimate cares for.
    X = np.column_stack([library.X, library.groups])
    local = LocalEstimator(
        lambda local: CountingProcess(replace(PRIOR, theta=np.full(5, 2.0))), SITUATION, 84
    )
    GIVEN.clear()
    # Each goal has 8 x 21 rows: 84 are half of those at the nearest.
    local.fit(X, library.y, library.groups).value_and_gradient([0.5, 0.1, 0.0, 1.0, 0.0])
    assert set(GIVEN[0][0][:, 4]) == set(range(8))


def chosen(X, y, groups) -> GaussianProcess:
    local = LocalEstimator(choose_process, SITUATION, length_scale=np.array([0.1, 0.1, 0.1, 0.3]))
    return local.fit(X, y, groups).model_


def test_a_surface_without_chance_gets_less_noise_than_coin_tosses(world) -> None:
    grid = world.grid()
    X, groups = np.tile(grid, (6, 1)), np.repeat(np.arange(6), len(grid))
    sure = (world.probability(X) > 0.5).astype(float)
    coins = (np.random.default_rng(0).random(len(X)) < 0.5).astype(float)
    noises = [chosen(X, y, groups).hyperparameters.reach_variance for y in (sure, coins)]
    assert noises[0] < 0.01 < 1.0 < noises[1]


def test_outcomes_repeated_within_environments_are_not_taken_for_evidence(world) -> None:
    """As in D2, where the same second reaches follow every failed first one."""
    library = world.library(environments=4)
    single = (library.X, library.y, library.groups)
    repeated = (np.tile(library.X, (5, 1)), np.tile(library.y, 5), np.tile(library.groups, 5))
    grid = world.grid()
    truth = world.probability(grid)
    error = [
        np.mean((chosen(*rows).fit(*rows).values(grid) - truth) ** 2) for rows in (repeated, single)
    ]
    assert error[0] < 2.0 * error[1] < 0.5 * np.var(truth)


def test_a_single_environment_leaves_nothing_to_hold_out(scattered) -> None:
    process = chosen(scattered.X, scattered.y, np.zeros(60))
    assert process.hyperparameters.reach_variance > 0.0
