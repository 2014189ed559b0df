import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.neighbors import KNeighborsRegressor

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.nearest_neighbours import NearestNeighbours

# Of the four features of cylinder-clutter.
BANDWIDTH = np.array([0.08, 0.15, 0.1, 0.4])


def _gaussian(distance):
    return np.exp(-0.5 * distance**2)


@pytest.mark.parametrize("neighbours", [1, 7, 60, 500])
def test_predictions_equal_those_of_scikit_learn_on_distinct_rows(scattered, neighbours) -> None:
    theirs = KNeighborsRegressor(min(neighbours, 60), weights=_gaussian).fit(
        scattered.Z / BANDWIDTH, scattered.f
    )
    ours = NearestNeighbours(neighbours=neighbours, bandwidth=BANDWIDTH)
    ours.fit(scattered.Z, scattered.f)
    queries = scattered.Z[:20] + 0.02
    expected = theirs.predict(queries / BANDWIDTH)
    np.testing.assert_allclose(ours.values(queries), expected, rtol=1e-9, atol=1e-12)


def test_repeated_rows_count_as_one_neighbour_each_time(world) -> None:
    library = world.library(environments=5)
    grid = world.grid()
    theirs = KNeighborsRegressor(5 * 40, weights=_gaussian)
    theirs.fit(library.Z / BANDWIDTH, library.f)
    ours = NearestNeighbours(neighbours=40, bandwidth=BANDWIDTH).fit(library.Z, library.f)
    queries = np.random.default_rng(1).uniform(grid.min(axis=0), grid.max(axis=0), (30, 4))
    np.testing.assert_allclose(
        ours.predict(queries).probability, theirs.predict(queries / BANDWIDTH), rtol=1e-9
    )


def test_given_other_rows_the_bandwidths_stay(scattered) -> None:
    ours = NearestNeighbours(neighbours=20).fit(scattered.Z, scattered.f, scattered.environment)
    some = np.arange(0, 60, 2)
    other = ours.conditioned_on(scattered.Z[some], scattered.f[some])
    theirs = KNeighborsRegressor(20, weights=_gaussian).fit(
        scattered.Z[some] / ours.bandwidth, scattered.f[some]
    )
    queries = scattered.Z[:20] + 0.02
    expected = theirs.predict(queries / ours.bandwidth)
    np.testing.assert_allclose(other.values(queries), expected, rtol=1e-9)


def test_far_from_all_rows_the_nearest_decide() -> None:
    ours = NearestNeighbours(bandwidth=[0.005]).fit([[0.0], [1.0]], [0, 1])
    np.testing.assert_array_equal(ours.predict([[-50.0], [50.0]]).probability, [0.0, 1.0])


@settings(max_examples=50)
@given(st.integers(0, 10_000), st.sampled_from([5, 100]))
def test_the_gradient_equals_finite_differences(seed: int, neighbours: int) -> None:
    rng = np.random.default_rng(seed)
    Z = rng.uniform(size=(30, 3)) * [1.0, 10.0, 0.1]
    scale = np.array([0.3, 2.0, 0.02])
    ours = NearestNeighbours(neighbours=neighbours, bandwidth=scale)
    ours.fit(Z, rng.integers(0, 2, 30))
    z = rng.uniform(size=3) * [1.0, 10.0, 0.1]
    value, gradient = ours.value_and_gradient(z)
    distances = np.sort(np.linalg.norm((Z - z) / scale, axis=1))
    if neighbours < 30 and distances[neighbours] - distances[neighbours - 1] < 1e-4:
        return  # the set of neighbours changes within the difference
    numeric = [
        (ours.value_and_gradient(z + h)[0] - ours.value_and_gradient(z - h)[0]) / (2.0 * h.sum())
        for h in 1e-6 * np.diag(scale)
    ]
    np.testing.assert_allclose(gradient * scale, numeric * scale, rtol=1e-4, atol=1e-6)
    assert value == pytest.approx(ours.predict([z]).probability[0], abs=1e-12)


def test_the_spread_is_that_of_the_weighted_mean_over_repeated_draws() -> None:
    rng = np.random.default_rng(0)
    Z = np.repeat(np.linspace(0.0, 1.0, 30), 10)[:, None]
    estimates, spreads = [], []
    for _ in range(400):
        f = (rng.random(len(Z)) < 0.7).astype(float)
        prediction = NearestNeighbours(bandwidth=[0.12]).fit(Z, f).predict([[0.4]])
        estimates.append(prediction.probability[0])
        spreads.append(prediction.spread[0])
    assert np.mean(spreads) == pytest.approx(np.std(estimates), rel=0.1)


def test_a_rough_surface_gets_a_smaller_bandwidth_than_a_flat_one() -> None:
    rng = np.random.default_rng(0)
    Z = rng.uniform(size=(2000, 1))
    environment = np.arange(2000) % 10
    rough = rng.random(2000) < 0.5 + 0.45 * np.sign(np.sin(40.0 * Z[:, 0]))
    flat = rng.random(2000) < 0.5
    bandwidth = {
        name: NearestNeighbours().fit(Z, f, environment).bandwidth[0]
        for name, f in (("rough", rough), ("flat", flat))
    }
    assert bandwidth["rough"] < 0.5 * bandwidth["flat"]


def test_luck_shared_within_environments_widens_the_bandwidth(flat_world) -> None:
    alike = flat_world.library(environments=8, shared_luck=0.4)
    knowing = NearestNeighbours().fit(alike.Z, alike.f, alike.environment)
    unknowing = NearestNeighbours().fit(alike.Z, alike.f)
    assert np.prod(knowing.bandwidth) > np.prod(unknowing.bandwidth)


def test_each_feature_gets_its_own_bandwidth_in_its_unit() -> None:
    rng = np.random.default_rng(0)
    Z = rng.uniform(size=(2000, 3)) * [1.0, 100.0, 1.0]
    Z[:, 2] = 0.335  # always the same: no search along it
    f = rng.random(2000) < 0.5 + 0.45 * np.sign(np.sin(40.0 * Z[:, 0]))
    bandwidth = NearestNeighbours().fit(Z, f, np.arange(2000) % 10).bandwidth
    assert bandwidth[0] < 0.1  # a half wave is 0.08 long
    assert bandwidth[1] > 50.0  # tells nothing


@pytest.mark.parametrize(
    ("Z", "f", "expected"),
    [
        ([[0.5, 1.0]], [1], 1.0),
        ([[0.5, 1.0]] * 4, [1, 0, 0, 0], 0.25),
        ([[0.5, 1.0], [0.5, 2.0]], [1, 1], 1.0),
    ],
)
def test_degenerate_libraries_give_their_rate(Z, f, expected) -> None:
    ours = NearestNeighbours().fit(Z, f)
    value, gradient = ours.value_and_gradient([0.6, 1.5])
    assert value == pytest.approx(expected)
    np.testing.assert_allclose(gradient, 0.0, atol=1e-12)
    assert ours.predict([[0.6, 1.5]]).spread[0] > 0.0


def test_asking_before_fitting_says_what_to_do() -> None:
    ours = NearestNeighbours()
    with pytest.raises(EstimateError, match="call fit"):
        ours.predict(np.zeros((1, 4)))
    with pytest.raises(EstimateError, match="call fit"):
        ours.value_and_gradient(np.zeros(4))
    with pytest.raises(EstimateError, match="call fit"):
        _ = ours.bandwidth


@pytest.mark.parametrize(
    "settings", [{"neighbours": 0}, {"bandwidth": [0.1, 0.0]}, {"bandwidth": [np.nan]}]
)
def test_settings_that_make_no_sense_are_refused(settings) -> None:
    with pytest.raises(EstimateError, match="positive bandwidths"):
        NearestNeighbours(**settings)


def test_fitted_neighbours_survive_pickling(scattered) -> None:
    ours = NearestNeighbours(bandwidth=BANDWIDTH).fit(scattered.Z, scattered.f)
    copy = pickle.loads(pickle.dumps(ours))
    assert copy.value_and_gradient(scattered.Z[0])[0] == ours.value_and_gradient(scattered.Z[0])[0]
