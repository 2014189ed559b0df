"""What all success estimators have in common, ours and scikit-learn's."""

from collections.abc import Callable

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier, KNeighborsRegressor
from sklearn.tree import DecisionTreeClassifier
from sklearn.utils import estimator_checks

from lic_drake.errors import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator, from_sklearn
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.neighbours import (
    LocalEstimator,
    NearestNeighbours,
    choose_neighbours,
    choose_process,
)

MAKE: dict[str, Callable[[], SuccessEstimator]] = {
    "gp": GaussianProcess,
    "knn": NearestNeighbours,
    "local gp": lambda: LocalEstimator(choose_process, slice(0, 2), size=40),
    "local knn": lambda: LocalEstimator(choose_neighbours, slice(0, 2), size=40),
    "tree": lambda: from_sklearn(DecisionTreeClassifier(min_samples_leaf=5, random_state=0)),
}


@pytest.fixture(params=MAKE)
def estimator(request: pytest.FixtureRequest) -> SuccessEstimator:
    return MAKE[request.param]()


@pytest.mark.parametrize(
    "check",
    [
        "check_get_params_invariance",
        "check_set_params",
        "check_no_attributes_set_in_init",
        "check_fit_check_is_fitted",
        "check_estimators_pickle",
        "check_n_features_in",
        "check_methods_sample_order_invariance",
        "check_sample_weights_list",
    ],
)
def test_checks_of_scikit_learn_pass(estimator: SuccessEstimator, check: str) -> None:
    getattr(estimator_checks, check)(type(estimator).__name__, estimator)


def test_a_clone_has_the_settings_and_not_the_rows(estimator, scattered) -> None:
    fitted = estimator.fit(scattered.X, scattered.y, scattered.groups)
    copy = clone(fitted)
    assert repr(copy.get_params()) == repr(fitted.get_params())
    with pytest.raises(EstimateError, match=r"no rows yet; call fit\(X, y\)"):
        copy.values(scattered.X)
    again = copy.fit(scattered.X, scattered.y, groups=scattered.groups)
    np.testing.assert_array_equal(again.values(scattered.X), fitted.values(scattered.X))


def test_probabilities_are_clipped_values_and_classes_the_likelier_outcomes(
    estimator, scattered
) -> None:
    fitted = estimator.fit(scattered.X, scattered.y)
    queries = scattered.X + 0.05
    success = np.clip(fitted.values(queries), 0.0, 1.0)
    np.testing.assert_array_equal(fitted.predict_proba(queries)[:, 1], success)
    np.testing.assert_allclose(fitted.predict_proba(queries).sum(axis=1), 1.0)
    assert fitted.classes_.tolist() == [0, 1]
    assert fitted.score(queries, success >= 0.5) == 1.0
    value, gradient = fitted.value_and_gradient(queries[7])
    assert value == pytest.approx(fitted.values(queries)[7], abs=1e-12)
    assert gradient.shape == (4,)


@pytest.mark.parametrize("outcome", [0.0, 1.0])
def test_if_all_reaches_end_alike_that_is_the_estimate(estimator, scattered, outcome) -> None:
    fitted = estimator.fit(scattered.X, np.full(60, outcome))
    np.testing.assert_allclose(fitted.values(scattered.X[:5] + 0.05), outcome, atol=1e-6)
    np.testing.assert_allclose(fitted.value_and_gradient(scattered.X[0])[1], 0.0, atol=1e-6)


def test_a_heavy_contradiction_turns_the_estimate_and_a_light_one_does_not(estimator) -> None:
    rng = np.random.default_rng(3)
    X = rng.uniform(size=(120, 4))
    # The simulation says "to the left"; reality says "to the right".
    y = (X[:, 0] < 0.5).astype(float)
    estimator.fit(X, y, np.arange(120) // 10)
    everything, success = np.vstack([X, X + 1e-3]), np.concatenate([y, 1.0 - y])
    left, right = X[X[:, 0] < 0.2], X[X[:, 0] > 0.8]
    for weight, sign in ((0.01, 1.0), (100.0, -1.0)):
        weights = np.repeat([1.0, weight], 120)
        conditioned = estimator.conditioned_on(everything, success, weights)
        gap = conditioned.values(left).mean() - conditioned.values(right).mean()
        assert sign * gap > 0.2
        assert type(conditioned) is type(estimator)


def test_what_cannot_be_used_is_refused_and_changes_nothing(estimator, scattered) -> None:
    X, y = scattered.X, scattered.y
    before = estimator.fit(X, y).values(X)
    hole = np.where(np.arange(60)[:, None] == 3, np.nan, X)
    for arguments, said in (
        ((hole, y), "the first is row 3"),
        ((X, y, np.zeros(3)), "groups needs one entry a row .60"),
        ((X, y, None, np.ones(3)), "sample_weight needs one entry a row .60"),
    ):
        with pytest.raises(EstimateError, match=said):
            estimator.fit(*arguments)
    with pytest.raises(EstimateError, match="finite"):
        estimator.value_and_gradient(hole[3])
    with pytest.raises(EstimateError, match=r"shape \(n, 4\)"):
        estimator.values(X[:, :3])
    np.testing.assert_array_equal(estimator.values(X), before)


def test_any_classifier_or_regressor_of_scikit_learn_comes_in_by_one_call(world) -> None:
    library = world.library(environments=2)
    queries = world.grid()[::50] + 0.01
    for model in (KNeighborsClassifier(30), LogisticRegression()):
        ours = from_sklearn(model).fit(library.X, library.y, library.groups)
        theirs = clone(model).fit(library.X, library.y).predict_proba(queries)
        np.testing.assert_allclose(ours.predict_proba(queries), theirs)
    regressor = from_sklearn(KNeighborsRegressor(30)).fit(library.X, library.y)
    classifier = from_sklearn(KNeighborsClassifier(30)).fit(library.X, library.y)
    np.testing.assert_allclose(regressor.values(queries), classifier.values(queries))


def test_weights_reach_a_model_that_takes_them(scattered) -> None:
    weight = np.arange(1.0, 61.0)
    ours = from_sklearn(LogisticRegression()).fit(scattered.X, scattered.y, sample_weight=weight)
    theirs = LogisticRegression().fit(scattered.X, scattered.y, weight)
    np.testing.assert_allclose(ours.predict_proba(scattered.X), theirs.predict_proba(scattered.X))
    with pytest.raises(EstimateError, match="KNeighborsClassifier cannot weight its rows"):
        from_sklearn(KNeighborsClassifier()).fit(scattered.X, scattered.y, sample_weight=weight)


class Quadratic(SuccessEstimator):
    """A user's estimator of five lines: it gives no gradient of its own."""

    def _fit(self, X, y, groups, weight) -> None:
        self.centre = np.average(X, axis=0, weights=weight)

    def _values(self, X):
        return 0.8 - np.sum((X - self.centre) ** 2, axis=1)


def test_the_numerical_gradient_is_exact_for_a_quadratic(scattered) -> None:
    fitted = Quadratic().fit(scattered.X, scattered.y)
    x = np.array([0.5, 0.1, -0.2, 0.7])
    value, gradient = fitted.value_and_gradient(x)
    assert value == fitted.values(x[None])[0]
    np.testing.assert_allclose(gradient, -2.0 * (x - scattered.X.mean(axis=0)), atol=1e-12)
    # Without settings of its own, conditioning is fitting anew.
    other = fitted.conditioned_on(scattered.X[:5], scattered.y[:5])
    np.testing.assert_array_equal(other.centre, scattered.X[:5].mean(axis=0))
