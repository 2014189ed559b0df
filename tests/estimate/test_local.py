import numpy as np
import pytest

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.likelihood import Hyperparameters
from lic_drake.estimate.local import LocalEstimator, Neighbourhoods

SITUATION = slice(0, 2)
PRIOR = Hyperparameters(
    theta=np.full(4, 2.0), signal_variance=0.05, noise_floor=1e-3, reach_variance=0.2
)


class CountingProcess(GaussianProcess):
    """Counts how often rows are given to it."""

    def __init__(self) -> None:
        super().__init__(hyperparameters=PRIOR)
        self.given: list[tuple[np.ndarray, np.ndarray]] = []

    def conditioned_on(self, Z, f, weight=1.0):
        self.given.append((Z, f))
        return super().conditioned_on(Z, f, weight)


@pytest.fixture
def process() -> CountingProcess:
    return CountingProcess()


@pytest.fixture
def choose(process):
    """Notes the neighbourhoods it is called with."""

    def choose_model(near: Neighbourhoods) -> CountingProcess:
        choose_model.near = near
        return process

    return choose_model


def test_the_local_model_is_the_one_given_the_rows_of_the_nearest_situations(
    world, process, choose
) -> None:
    library = world.library(environments=3)
    local = LocalEstimator(choose, SITUATION, size=2 * 63)
    local.fit(library.Z, library.f, library.environment)
    queries = np.array([[0.512, -0.213, 0.1, 1.2], [0.512, -0.213, -0.3, 0.2]])
    values = local.values(queries)
    assert len(process.given) == 1

    scale = choose.near.length_scale[:2]
    centre = scale * 0.5 * np.round(queries[0, :2] / scale / 0.5)
    distance = np.linalg.norm((library.Z[:, :2] - centre) / scale, axis=1)
    near = distance < np.sort(np.unique(distance.round(9)))[2] - 1e-6
    assert near.sum() == 2 * 63
    expected = process.conditioned_on(library.Z[near], library.f[near])
    np.testing.assert_allclose(values, expected.values(queries))
    prediction = local.predict(queries)
    np.testing.assert_allclose(prediction.probability, expected.predict(queries).probability)
    np.testing.assert_allclose(prediction.spread, expected.predict(queries).spread)
    value, gradient = local.value_and_gradient(queries[0])
    assert value == pytest.approx(expected.value_and_gradient(queries[0])[0])
    np.testing.assert_allclose(gradient, expected.value_and_gradient(queries[0])[1])


def test_length_scales_say_which_feature_of_the_situation_matters(process, choose) -> None:
    rng = np.random.default_rng(0)
    Z = rng.uniform(size=(3000, 4))
    f = (rng.random(3000) < 0.5 + 0.45 * np.sign(Z[:, 0] - 0.5)).astype(float)
    LocalEstimator(choose, SITUATION, size=100).fit(Z, f, np.arange(3000) // 10)
    near = choose.near
    assert near.length_scale[0] < 0.5 * near.length_scale[1]
    rows = near.nearest(near.in_scales(np.array([0.5, 0.5, 0.0, 0.0])), 100)
    assert np.std(near.Z[rows, 0]) < 0.5 * np.std(near.Z[rows, 1])


def test_an_optimisation_at_one_goal_gives_rows_once(world, process, choose) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(choose, SITUATION, size=100).fit(library.Z, library.f)
    for y in np.linspace(-0.4, 0.4, 20):
        local.value_and_gradient([0.5, 0.1, y, 1.0])
    assert len(process.given) == 1
    local.value_and_gradient([0.5, 0.4, 0.0, 1.0])
    assert len(process.given) == 2


def test_a_base_that_moves_the_situation_needs_a_model_each_half_length_scale(
    world, process, choose
) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(choose, SITUATION, size=100).fit(library.Z, library.f)
    Z = np.column_stack([np.full(1000, 0.5), np.linspace(-0.4, 0.4, 1000), np.zeros((1000, 2))])
    local.values(Z)
    assert len(process.given) <= 2 + 0.8 / (0.5 * choose.near.length_scale[1])


def test_fitting_again_forgets_local_models_of_old_rows(world, choose) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(choose, SITUATION, size=100).fit(library.Z, library.f)
    z = np.array([0.5, 0.1, 0.0, 1.0])
    before = local.value_and_gradient(z)[0]
    local.fit(library.Z, 1.0 - library.f)
    assert local.value_and_gradient(z)[0] == pytest.approx(1.0 - before)


def test_many_goals_keep_memory_bounded_and_answers_right(world, choose) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(choose, SITUATION, size=50).fit(library.Z, library.f)
    x, y = np.meshgrid(np.linspace(0.4, 0.8, 20), np.linspace(-0.4, 0.4, 20))
    queries = np.column_stack([x.ravel(), y.ravel(), np.zeros((400, 2))])
    together = local.values(queries)
    assert len(local._cache) <= 64
    alone = [local.values(query[None])[0] for query in queries]
    np.testing.assert_allclose(together, alone)


def test_a_library_below_the_size_is_used_as_a_whole(scattered, process, choose) -> None:
    local = LocalEstimator(choose, SITUATION, size=60)
    local.fit(scattered.Z, scattered.f, scattered.environment)
    whole = GaussianProcess(hyperparameters=PRIOR).fit(scattered.Z, scattered.f)
    np.testing.assert_allclose(local.values(scattered.Z + 0.01), whole.values(scattered.Z + 0.01))
    assert len(process.given) == 1


def test_rows_at_equal_distance_come_from_all_environments(world, process, choose) -> None:
    library = world.library(environments=8)
    local = LocalEstimator(choose, SITUATION, size=84)
    local.fit(library.Z, library.f, library.environment)
    # Each goal has 8 x 21 rows: 84 are half of those at the nearest.
    local.value_and_gradient([0.5, 0.1, 0.0, 1.0])
    near = choose.near
    rows = near.nearest(local._cell(np.array([0.5, 0.1, 0.0, 1.0])), 84)
    assert set(near.environment[rows]) == set(range(8))
    np.testing.assert_array_equal(process.given[0][0], near.Z[rows])


def test_rows_can_be_chosen_among_some(scattered, choose) -> None:
    LocalEstimator(choose, SITUATION).fit(scattered.Z, scattered.f, scattered.environment)
    near = choose.near
    among = near.environment == near.environment[0]
    centre = near.in_scales(near.Z[0])
    rows = near.nearest(centre, 3, among)
    distance = np.linalg.norm(near.in_scales(near.Z) - centre, axis=1)
    assert set(rows) == set(np.flatnonzero(among)[np.argsort(distance[among])[:3]])
    np.testing.assert_array_equal(near.nearest(centre, 100, among), np.flatnonzero(among))


def test_asking_before_fitting_says_what_to_do(choose) -> None:
    local = LocalEstimator(choose, SITUATION)
    for ask in (local.predict, local.values):
        with pytest.raises(EstimateError, match="call fit"):
            ask(np.zeros((1, 4)))
    with pytest.raises(EstimateError, match="call fit"):
        local.value_and_gradient(np.zeros(4))


def test_a_size_that_makes_no_sense_is_refused(choose) -> None:
    with pytest.raises(EstimateError, match="size 1"):
        LocalEstimator(choose, SITUATION, size=1)


def test_environments_of_another_length_are_refused(scattered, choose) -> None:
    with pytest.raises(EstimateError, match="one entry for each of 60"):
        LocalEstimator(choose, SITUATION).fit(scattered.Z, scattered.f, np.zeros(3))
