import numpy as np
import pytest

from lic_drake.estimate import registry
from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.cross_validation import hold_out_environments, score
from lic_drake.estimate.features import PLANAR_LIC1, ExperienceRows
from lic_drake.estimate.registry import estimator_names, make_estimator, register_estimator

NAMES = ("gp", "knn", "gp-raw")


def test_the_paper_s_estimators_are_known_with_the_averaged_process_first() -> None:
    assert estimator_names() == NAMES


def test_an_unknown_estimator_is_named_with_the_known_ones() -> None:
    with pytest.raises(EstimateError, match=r"'forest'.*gp, knn"):
        make_estimator("forest")


def test_an_estimator_can_be_added_by_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry._ESTIMATORS, "entries", dict(registry._ESTIMATORS.entries))
    given = []
    register_estimator("mine", lambda features: given.append(features) or make_estimator("knn"))
    assert make_estimator("mine") is not make_estimator("mine")
    assert given == [PLANAR_LIC1, PLANAR_LIC1]


@pytest.mark.parametrize("name", NAMES)
def test_every_estimator_learns_a_known_surface(world, name: str) -> None:
    """Better than the constant rate on held-out environments, and nearly the best start."""
    library = world.library(environments=8)
    rows = ExperienceRows(Z=library.Z, f=library.f, environment=library.environment)
    held_out = hold_out_environments(lambda: make_estimator(name), rows, folds=2)
    result = score(held_out, PLANAR_LIC1.situation)
    assert result.gain > 5.0 * result.gain_error

    estimator = make_estimator(name).fit(library.Z, library.f, library.environment)
    starts = world.grid()[:21, 2:]
    rng = np.random.default_rng(0)
    lost = []
    for goal in rng.uniform([0.4, -0.4], [0.8, 0.4], (15, 2)):
        Z = np.column_stack([np.tile(goal, (len(starts), 1)), starts])
        truth = world.probability(Z)
        lost.append(truth.max() - truth[np.argmax(estimator.predict(Z).probability)])
    assert np.mean(lost) < 0.03


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [60, 20_000])
def test_many_values_are_those_of_single_queries(world, scattered, name: str, size: int) -> None:
    library = scattered if size == 60 else world.library(environments=3)
    estimator = make_estimator(name).fit(library.Z, library.f, library.environment)
    rng = np.random.default_rng(0)
    Z = rng.uniform([0.4, -0.4, -0.4, -1.0], [0.8, 0.4, 0.4, 1.5], (12, 4))
    Z[1::3, PLANAR_LIC1.situation] = Z[0, PLANAR_LIC1.situation]
    single = [estimator.value_and_gradient(z)[0] for z in Z]
    np.testing.assert_allclose(estimator.values(Z), single, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_fitting_twice_on_the_same_rows_gives_the_same_estimate(scattered, name: str) -> None:
    z = scattered.Z[7] + 0.01
    first, second = (
        make_estimator(name).fit(scattered.Z, scattered.f).value_and_gradient(z) for _ in range(2)
    )
    assert first[0] == second[0]
    assert np.array_equal(first[1], second[1])


@pytest.mark.parametrize("name", NAMES)
def test_every_estimator_refuses_nan_by_name(scattered, name: str) -> None:
    Z = scattered.Z.copy()
    Z[3, 1] = np.nan
    with pytest.raises(EstimateError, match="row 3"):
        make_estimator(name).fit(Z, scattered.f)
    fitted = make_estimator(name).fit(scattered.Z, scattered.f)
    with pytest.raises(EstimateError, match="finite"):
        fitted.value_and_gradient(Z[3])
