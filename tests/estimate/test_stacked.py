import numpy as np
import pytest

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.estimator import UpdatableEstimator
from lic_drake.estimate.registry import make_estimator
from lic_drake.estimate.stacked import StackedEstimator

FEATURES = features_of("sphere-aperture-clutter").second
NAMES = FEATURES.names
LATER = [NAMES.index("start_y"), NAMES.index("start_z")]
EARLIER = [NAMES.index("first_start_y"), NAMES.index("first_start_z")]
GOAL = [NAMES.index("goal_y"), NAMES.index("goal_z")]


def pairs(n: int = 1500) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reaches succeed from within 0.25 m of the goal, but not within 0.15 m of a failed start."""
    rng = np.random.default_rng(5)
    Z = rng.uniform(-0.4, 0.4, (n, len(NAMES)))
    # Half of the second starts are near the failed ones.
    Z[::2][:, LATER] = Z[::2][:, EARLIER] + rng.uniform(-0.2, 0.2, (len(Z[::2]), 2))
    near = np.linalg.norm(Z[:, LATER] - Z[:, GOAL], axis=1) < 0.25
    spoilt = np.linalg.norm(Z[:, LATER] - Z[:, EARLIER], axis=1) < 0.15
    return Z, (near & ~spoilt).astype(float), np.arange(n) % 20


@pytest.fixture(scope="module")
def fitted() -> StackedEstimator:
    estimator = make_estimator("gp", FEATURES)
    assert isinstance(estimator, StackedEstimator)
    return estimator.fit(*pairs())


def at(later: tuple[float, float], earlier: tuple[float, float]) -> np.ndarray:
    z = np.zeros(len(NAMES))
    z[LATER], z[EARLIER] = later, earlier
    return z


def test_a_start_near_a_failed_one_is_worth_less(fitted: StackedEstimator) -> None:
    beside, apart = fitted.values(np.array([at((0.1, 0), (0.1, 0)), at((0.1, 0), (-0.3, 0.3))]))
    assert apart > beside + 0.3
    far = fitted.values(at((0.38, 0.38), (-0.3, 0.3))[None])[0]
    assert far < apart - 0.3  # Far from the goal, as LIC-1 knows.


def test_the_gradient_is_that_of_the_estimate(fitted: StackedEstimator) -> None:
    z, step = at((0.12, 0.03), (-0.11, 0.2)), 1e-6
    value, gradient = fitted.value_and_gradient(z)
    assert value == pytest.approx(float(fitted.values(z[None])[0]), abs=1e-9)
    steps = step * np.eye(len(z))
    numeric = (fitted.values(z + steps) - fitted.values(z - steps)) / (2.0 * step)
    np.testing.assert_allclose(gradient, numeric, atol=5e-3)


def test_estimates_are_clipped_only_as_probabilities(fitted: StackedEstimator) -> None:
    Z = pairs(50)[0]
    expected = np.clip(fitted.values(Z), 0.0, 1.0)
    np.testing.assert_allclose(fitted.predict(Z).probability, expected)


def test_misuse_is_refused() -> None:
    empty = make_estimator("knn", FEATURES)
    with pytest.raises(EstimateError, match="no rows yet"):
        empty.values(np.zeros((1, len(NAMES))))
    Z, f, _ = pairs(20)
    with pytest.raises(EstimateError, match="20 rows need as many environments"):
        empty.fit(Z, f, np.zeros(19))


@pytest.mark.parametrize("name", ["gp", "knn"])
def test_it_goes_on_learning(name: str) -> None:
    Z, f, environment = pairs(600)
    estimator = make_estimator(name, FEATURES).fit(Z, f, environment)
    assert isinstance(estimator, UpdatableEstimator)
    asked = at((0.1, 0.0), (-0.3, 0.3))
    before = estimator.values(asked[None])[0]
    # Ten reaches, each after three failures, say that nothing succeeds there any more.
    rng = np.random.default_rng(1)
    rows = np.repeat(asked + rng.normal(0.0, 0.005, (10, len(asked))), 3, axis=0)
    rows[:, EARLIER] += rng.normal(0.0, 0.01, (30, 2))
    estimator.update(rows, np.zeros(30), 20.0)
    assert estimator.values(asked[None])[0] < before - 0.3
