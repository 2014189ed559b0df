import numpy as np
import pytest

from lic_drake.errors import EstimateError
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters
from lic_drake.estimate.local import LocalEstimator, Neighbourhoods, choose_process
from lic_drake.estimate.rows import average_rows

SITUATION = slice(0, 2)
PRIOR = Hyperparameters(
    theta=np.full(4, 2.0), signal_variance=0.05, noise_floor=1e-3, reach_variance=0.2
)
GIVEN: list[tuple[np.ndarray, np.ndarray]] = []


class CountingProcess(GaussianProcess):
    """Notes the rows that are given to any of its clones."""

    def _fit(self, X, y, groups, weight) -> None:
        GIVEN.append((X, y))
        super()._fit(X, y, groups, weight)


def choose(near: Neighbourhoods) -> CountingProcess:
    return CountingProcess(PRIOR)


@pytest.fixture(autouse=True)
def _nothing_given() -> None:
    GIVEN.clear()


def test_the_local_model_is_the_one_given_the_rows_of_the_nearest_situations(world) -> None:
    library = world.library(environments=3)
    local = LocalEstimator(choose, SITUATION, size=2 * 63)
    local.fit(library.X, library.y, library.groups)
    queries = np.array([[0.512, -0.213, 0.1, 1.2], [0.512, -0.213, -0.3, 0.2]])
    values = local.values(queries)
    assert len(GIVEN) == 1

    scale = local._near.length_scale[:2]
    centre = scale * 0.5 * np.round(queries[0, :2] / scale / 0.5)
    distance = np.linalg.norm((library.X[:, :2] - centre) / scale, axis=1)
    near = distance < np.sort(np.unique(distance.round(9)))[2] - 1e-6
    assert near.sum() == 2 * 63
    expected = GaussianProcess(PRIOR).fit(library.X[near], library.y[near])
    np.testing.assert_allclose(values, expected.values(queries))
    value, gradient = local.value_and_gradient(queries[0])
    assert value == pytest.approx(expected.value_and_gradient(queries[0])[0])
    np.testing.assert_allclose(gradient, expected.value_and_gradient(queries[0])[1])


def test_length_scales_say_which_feature_of_the_situation_matters() -> None:
    rng = np.random.default_rng(0)
    X = rng.uniform(size=(3000, 4))
    y = (rng.random(3000) < 0.5 + 0.45 * np.sign(X[:, 0] - 0.5)).astype(float)
    near = LocalEstimator(choose, SITUATION, size=100).fit(X, y, np.arange(3000) // 10)._near
    assert near.length_scale[0] < 0.5 * near.length_scale[1]
    rows = near.nearest(near.in_scales(np.array([0.5, 0.5, 0.0, 0.0])), 100)
    assert np.std(near.X[rows, 0]) < 0.5 * np.std(near.X[rows, 1])


def test_models_are_shared_by_all_starts_of_a_situation_and_half_a_length_scale(world) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(choose, SITUATION, size=100).fit(library.X, library.y)
    for y in np.linspace(-0.4, 0.4, 20):
        local.value_and_gradient([0.5, 0.1, y, 1.0])
    assert len(GIVEN) == 1
    X = np.column_stack([np.full(1000, 0.5), np.linspace(-0.4, 0.4, 1000), np.zeros((1000, 2))])
    local.values(X)
    assert 2 < len(GIVEN) <= 3 + 0.8 / (0.5 * local._near.length_scale[1])


def test_a_library_below_the_size_is_used_as_a_whole_with_its_weights(scattered) -> None:
    local = LocalEstimator(choose, SITUATION, size=60)
    weight = np.repeat([1.0, 3.0], [40, 20])
    local.fit(scattered.X, scattered.y, scattered.groups, weight)
    whole = GaussianProcess(PRIOR).fit(scattered.X, scattered.y, sample_weight=weight)
    np.testing.assert_allclose(local.values(scattered.X + 0.01), whole.values(scattered.X + 0.01))
    assert len(GIVEN) == 1


def test_rows_at_equal_distance_come_from_all_environments(world) -> None:
    library = world.library(environments=8)
    local = LocalEstimator(choose, SITUATION, size=84)
    local.fit(library.X, library.y, library.groups)
    # Each goal has 8 x 21 rows: 84 are half of those at the nearest.
    local.value_and_gradient([0.5, 0.1, 0.0, 1.0])
    near = local._near
    rows = near.nearest(local._cell(np.array([0.5, 0.1, 0.0, 1.0])), 84)
    assert set(near.groups[rows]) == set(range(8))
    np.testing.assert_array_equal(GIVEN[0][0], near.X[rows])


def test_a_size_that_makes_no_sense_is_refused(scattered) -> None:
    with pytest.raises(EstimateError, match="size 1"):
        LocalEstimator(choose, SITUATION, size=1).fit(scattered.X, scattered.y)


# Settings of a local process


def _near(X, y, groups, length_scale) -> Neighbourhoods:
    order = np.random.default_rng(0).permutation(len(y))
    return Neighbourhoods(
        X=X[order],
        y=y[order],
        groups=groups[order],
        weight=np.ones(len(y)),
        situation=SITUATION,
        length_scale=np.asarray(length_scale),
    )


def test_a_surface_without_chance_gets_less_noise_than_coin_tosses(world) -> None:
    grid = world.grid()
    X, groups = np.tile(grid, (6, 1)), np.repeat(np.arange(6), len(grid))
    sure = (world.probability(X) > 0.5).astype(float)
    coins = (np.random.default_rng(0).random(len(X)) < 0.5).astype(float)
    noises = [
        choose_process(_near(X, y, groups, [0.1, 0.1, 0.1, 0.3])).hyperparameters.reach_variance
        for y in (sure, coins)
    ]
    assert noises[0] < 0.01 < 1.0 < noises[1]


def test_outcomes_repeated_within_environments_are_not_taken_for_evidence(world) -> None:
    """As in D2, where the same second reaches follow every failed first one."""
    library = world.library(environments=4)
    X, y, groups = np.tile(library.X, (5, 1)), np.tile(library.y, 5), np.tile(library.groups, 5)
    process = choose_process(_near(X, y, groups, [0.1, 0.1, 0.1, 0.3]))
    single = choose_process(_near(library.X, library.y, library.groups, [0.1, 0.1, 0.1, 0.3]))
    rows = average_rows(library.X, library.y)
    truth = world.probability(rows.X)
    error = [
        np.mean((p.fit(*data).values(rows.X) - truth) ** 2)
        for p, data in ((process, (X, y)), (single, (library.X, library.y)))
    ]
    assert error[0] < 2.0 * error[1] < 0.5 * np.var(truth)


def test_a_single_environment_leaves_nothing_to_hold_out(scattered) -> None:
    near = _near(scattered.X, scattered.y, np.zeros(60), np.ones(4))
    assert choose_process(near).hyperparameters.reach_variance > 0.0
