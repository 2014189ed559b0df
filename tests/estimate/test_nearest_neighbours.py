import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.neighbors import KNeighborsRegressor

from lic_drake.errors import EstimateError
from lic_drake.estimate.nearest_neighbours import NearestNeighbours

# Of the four features of cylinder-clutter.
BANDWIDTH = np.array([0.08, 0.15, 0.1, 0.4])


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


def test_a_weight_counts_as_that_many_equal_reaches(scattered) -> None:
    X, y, groups = scattered.X, scattered.y, scattered.groups
    count = np.arange(60) % 3 + 1
    weighted = NearestNeighbours().fit(X, y, groups, count)
    repeated = NearestNeighbours().fit(*(np.repeat(p, count, axis=0) for p in (X, y, groups)))
    # The scale of a feature counts rows, and may differ a little.
    np.testing.assert_allclose(weighted.bandwidth_, repeated.bandwidth_, rtol=1e-12)
    np.testing.assert_allclose(weighted.values(X), repeated.values(X), rtol=1e-9)


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


def test_luck_shared_within_environments_widens_the_bandwidth(world) -> None:
    alike = type(world)(relief=0.3).library(environments=8, shared_luck=0.4)
    knowing = NearestNeighbours().fit(alike.X, alike.y, alike.groups)
    unknowing = NearestNeighbours().fit(alike.X, alike.y)
    assert np.prod(knowing.bandwidth_) > np.prod(unknowing.bandwidth_)


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


@pytest.mark.parametrize(
    "settings", [{"neighbours": 0}, {"bandwidth": [0.1, 0.0]}, {"bandwidth": [np.nan]}]
)
def test_settings_that_make_no_sense_are_refused(settings) -> None:
    with pytest.raises(EstimateError, match="positive bandwidths"):
        NearestNeighbours(**settings).fit([[0.5, 1.0]], [1])
