import numpy as np
import pytest

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.likelihood import Hyperparameters
from lic_drake.estimate.local import LocalEstimator

SITUATION = slice(0, 2)


class CountingProcess(GaussianProcess):
    """Counts how often rows are given to it anew."""

    conditioned = 0

    def conditioned_on(self, Z, f):
        type(self).conditioned += 1
        return super().conditioned_on(Z, f)


@pytest.fixture
def process() -> CountingProcess:
    CountingProcess.conditioned = 0
    return CountingProcess(
        average=False,
        hyperparameters=Hyperparameters(
            theta=np.full(4, 2.0), signal_variance=0.05, noise_floor=1e-3, reach_variance=0.2
        ),
    )


def test_the_local_model_is_the_one_fitted_on_the_rows_of_the_nearest_goals(world, process) -> None:
    library = world.library(environments=3)
    goal = np.array([0.512, -0.213])
    local = LocalEstimator(process, SITUATION, size=2 * 63).fit(library.Z, library.f)
    offset = (library.Z[:, SITUATION] - goal) / library.Z[:, SITUATION].std(axis=0)
    distance = np.linalg.norm(offset, axis=1)
    near = distance <= np.sort(np.unique(distance))[1]
    assert near.sum() == 2 * 63
    expected = process.conditioned_on(library.Z[near], library.f[near])
    queries = np.array([[*goal, 0.1, 1.2], [*goal, -0.3, 0.2]])
    np.testing.assert_allclose(
        local.predict(queries).probability, expected.predict(queries).probability
    )
    np.testing.assert_allclose(local.predict(queries).spread, expected.predict(queries).spread)
    np.testing.assert_allclose(local.values(queries), expected.values(queries))
    value, gradient = local.value_and_gradient(queries[0])
    assert value == pytest.approx(expected.value_and_gradient(queries[0])[0])
    np.testing.assert_allclose(gradient, expected.value_and_gradient(queries[0])[1])


def test_an_optimisation_at_one_goal_fits_once(world, process) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(process, SITUATION, size=100).fit(library.Z, library.f)
    for y in np.linspace(-0.4, 0.4, 20):
        local.value_and_gradient([0.5, 0.1, y, 1.0])
    assert CountingProcess.conditioned == 1
    local.value_and_gradient([0.6, 0.1, 0.0, 1.0])
    assert CountingProcess.conditioned == 2


def test_fitting_again_forgets_local_models_of_old_rows(world, process) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(process, SITUATION, size=100).fit(library.Z, library.f)
    z = np.array([0.5, 0.1, 0.0, 1.0])
    before = local.value_and_gradient(z)[0]
    local.fit(library.Z, 1.0 - library.f)
    assert local.value_and_gradient(z)[0] == pytest.approx(1.0 - before)


def test_many_goals_keep_memory_bounded_and_answers_right(world, process) -> None:
    library = world.library(environments=1)
    local = LocalEstimator(process, SITUATION, size=50).fit(library.Z, library.f)
    queries = np.column_stack([np.linspace(0.4, 0.8, 50), *np.zeros((3, 50))])
    together = local.predict(queries).probability
    assert len(local._cache) <= 32
    alone = [local.predict(query[None]).probability[0] for query in queries]
    np.testing.assert_allclose(together, alone)


def test_a_library_below_the_size_is_used_as_a_whole(scattered) -> None:
    whole = GaussianProcess(average=False).fit(scattered.Z, scattered.f, scattered.environment)
    local = LocalEstimator(GaussianProcess(average=False), SITUATION, size=60)
    local.fit(scattered.Z, scattered.f, scattered.environment)
    z = scattered.Z[3] + 0.01
    # The order of the rows differs, which decides the start of the search.
    assert local.value_and_gradient(z)[0] == pytest.approx(whole.value_and_gradient(z)[0], abs=1e-3)


def test_rows_at_equal_distance_come_from_all_environments(world) -> None:
    class Recorder:
        def fit(self, Z, f, environment):
            return self

        def conditioned_on(self, Z, f):
            self.environments = set(Z[:, 4])
            return self

        def value_and_gradient(self, z):
            return 0.0, z

    library = world.library(environments=8)
    marked = np.column_stack([library.Z, library.environment])
    model = Recorder()
    local = LocalEstimator(model, SITUATION, size=84).fit(marked, library.f)
    # Each goal has 8 x 21 rows: 84 are half of those at the nearest.
    local.value_and_gradient([0.5, 0.1, 0.0, 1.0, 0.0])
    assert model.environments == set(range(8))


def test_asking_before_fitting_says_what_to_do(process) -> None:
    local = LocalEstimator(process, SITUATION)
    with pytest.raises(EstimateError, match="call fit"):
        local.predict(np.zeros((1, 4)))
    with pytest.raises(EstimateError, match="call fit"):
        local.value_and_gradient(np.zeros(4))


def test_a_size_that_makes_no_sense_is_refused(process) -> None:
    with pytest.raises(EstimateError, match="size 1"):
        LocalEstimator(process, SITUATION, size=1)
