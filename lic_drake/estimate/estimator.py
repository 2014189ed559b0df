"""The interface of success estimators: scikit-learn's, with unclipped values and gradients."""

from abc import ABC, abstractmethod
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, ClassifierMixin, clone, is_classifier
from sklearn.utils.validation import has_fit_parameter

from lic_drake.errors import EstimateError
from lic_drake.estimate.rows import (
    check_queries,
    check_rows,
    check_weights,
    feature_scale,
    selection_folds,
)
from lic_drake.types import Vector


class SuccessEstimator(ClassifierMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """F(s, x0) of paper III-D: an estimate of P(success), with its gradient for Eq. (4).

    A binary classifier in scikit-learn's sense, with classes 0 (failure) and 1 (success). A
    subclass follows scikit-learn's rules for constructor arguments, so that `clone` works, and
    implements `_fit` and `_values`, whose arguments are validated. It may override
    `_value_and_gradient` with an exact gradient, and `_settled` if `fit` chooses settings that
    later rows should not change.

    Attributes:
        gradient_step: Half width of the numerical gradient's central difference, in standard
            deviations of a feature; wide enough for piecewise constant estimates.
        classes_: 0 and 1.
        n_features_in_: Number of features d.
        scale_: Standard deviation of each feature, shape (d,).
    """

    gradient_step: float = 0.2

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        groups: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
    ) -> Self:
        """Fits to rows and returns itself.

        Args:
            X: Features, shape (n, d), see `lic_drake.estimate.features`.
            y: Successes, shape (n,), each 0 or 1.
            groups: Environment of each row, shape (n,): outcomes within one are correlated.
            sample_weight: Number of reaches that each row counts as, shape (n,); one by default.

        Raises:
            EstimateError: The rows are unusable.
        """
        X, y = check_rows(X, y)
        selection_folds(groups, len(y))  # Refuses groups of another length.
        known = None if groups is None else np.asarray(groups)
        return self._learn(X, y, known, check_weights(sample_weight, len(y)))

    def conditioned_on(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Returns a new estimator fitted to other rows, with the settings that `fit` chose here.

        Raises:
            EstimateError: Not fitted yet, or the rows are unusable.
        """
        self._check_fitted()
        return self._settled().fit(X, y, sample_weight=sample_weight)

    def values(self, X: ArrayLike) -> Vector:
        """Returns estimates for queries X, shape (n, d), not clipped to [0, 1]: shape (n,).

        Clipping would remove the gradient near 0 and 1 and tie the best starts.

        Raises:
            EstimateError: Not fitted yet, or unusable queries.
        """
        self._check_fitted()
        return self._values(check_queries(X, self.n_features_in_))

    def value_and_gradient(self, x: ArrayLike) -> tuple[float, Vector]:
        """Returns the unclipped estimate at x, shape (d,), and its gradient, shape (d,).

        Raises:
            EstimateError: Not fitted yet, or an unusable query.
        """
        self._check_fitted()
        return self._value_and_gradient(check_queries(np.atleast_2d(x), self.n_features_in_)[0])

    def predict_proba(self, X: ArrayLike) -> Vector:
        """Returns the probabilities of failure and success for queries X, shape (n, 2)."""
        success = np.clip(self.values(X), 0.0, 1.0)
        return np.column_stack([1.0 - success, success])

    def predict(self, X: ArrayLike) -> Vector:
        """Returns the more likely outcome of queries X, 0 or 1, shape (n,)."""
        return (self.values(X) >= 0.5).astype(np.float64)

    @abstractmethod
    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        """Fits to validated rows; see `fit`. `groups` is None or an array, shape (n,)."""

    @abstractmethod
    def _values(self, X: Vector) -> Vector:
        """Returns unclipped estimates for validated queries; see `values`."""

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        """Returns value and gradient at a validated query, by default by central differences."""
        h = self.gradient_step * self.scale_
        values = self._values(np.vstack([x, x + np.diag(h), x - np.diag(h)]))
        up, down = np.split(values[1:], 2)
        return float(values[0]), (up - down) / (2.0 * h)

    def _settled(self) -> Self:
        """Returns an unfitted estimator with the settings that `fit` chose."""
        return cast(Self, clone(self))

    def _learn(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> Self:
        """Fits to validated rows and returns itself."""
        self._fit(X, y, groups, weight)
        self.classes_ = np.array([0.0, 1.0])
        self.n_features_in_ = X.shape[1]
        self.scale_ = feature_scale(X)
        return self

    def _check_fitted(self) -> None:
        if not hasattr(self, "n_features_in_"):
            raise EstimateError(f"this {type(self).__name__} has no rows yet; call fit(X, y) first")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.classifier_tags.multi_class = False
        return tags


def from_sklearn(model: Any, gradient_step: float = 0.2) -> "SklearnEstimator":
    """Wraps a scikit-learn classifier or regressor as a success estimator.

    Args:
        model: The unfitted model. A classifier's estimate is its probability of class 1, a
            regressor's its prediction.
        gradient_step: See `SuccessEstimator`; small for a smooth model.
    """
    return SklearnEstimator(model, gradient_step)


class SklearnEstimator(SuccessEstimator):
    """See `from_sklearn`; `model_` is the fitted clone, None if all outcomes are equal."""

    def __init__(self, model: Any, gradient_step: float = 0.2) -> None:
        self.model = model
        self.gradient_step = gradient_step

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        options = {}
        if np.any(weight != weight[0]):
            if not has_fit_parameter(self.model, "sample_weight"):
                raise EstimateError(
                    f"{type(self.model).__name__} cannot weight its rows, but the library's weights"
                    " differ; choose a model whose fit takes sample_weight"
                )
            options["sample_weight"] = weight
        self._constant = float(y[0])
        alike = bool(np.all(y == y[0]))
        self.model_ = None if alike else clone(self.model).fit(X, y, **options)

    def _values(self, X: Vector) -> Vector:
        if self.model_ is None:
            return np.full(len(X), self._constant)
        if is_classifier(self.model_):
            return np.asarray(self.model_.predict_proba(X)[:, 1], dtype=np.float64)
        return np.asarray(self.model_.predict(X), dtype=np.float64)
