"""The interface of success estimators: scikit-learn's, with unclipped values and gradients."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, ClassifierMixin, clone, is_classifier
from sklearn.dummy import DummyRegressor
from sklearn.utils.validation import has_fit_parameter

from lic_drake.errors import EstimateError
from lic_drake.estimate.rows import check_rows, feature_scale
from lic_drake.types import Vector


class SuccessEstimator(ClassifierMixin, BaseEstimator, ABC):  # type: ignore[misc]
    """F(s, x0) of paper III-D: an estimate of P(success), with its gradient for Eq. (4).

    A binary classifier in scikit-learn's sense, with classes 0 (failure) and 1 (success). A
    subclass follows scikit-learn's rules for constructor arguments and implements `_fit` and
    `_values`, whose arguments are validated. It may override `_value_and_gradient` with an exact
    gradient. `_chosen` names those constructor arguments, such as `bandwidth`, that `fit` chooses,
    as `bandwidth_`, and that later rows should not change.

    Attributes:
        gradient_step: Half width of the numerical gradient's central difference, in standard
            deviations of a feature; wide enough for piecewise constant estimates.
        scale_: Standard deviation of each feature, shape (d,).
        solution_: What takes `fit` long even with given settings, shape (k,); None: nothing does.
    """

    gradient_step: float = 0.2
    _chosen: tuple[str, ...] = ()

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
        return self.resume(X, y, groups, sample_weight, solution=None)

    def resume(
        self,
        X: ArrayLike,
        y: ArrayLike,
        groups: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
        *,
        solution: Vector | None,
    ) -> Self:
        """Fits as `fit` does, given the `solution_` of a fit to the same rows and settings."""
        return self._learn(*check_rows(X, y, groups, sample_weight), solution)

    def conditioned_on(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None
    ) -> Self:
        """Returns a new estimator fitted to other rows, with the settings that `fit` chose here."""
        other = cast(Self, clone(self).set_params(**self.chosen))
        return other.fit(X, y, sample_weight=sample_weight)

    @property
    def chosen(self) -> dict[str, Any]:
        """Constructor arguments that `fit` has chosen here, by name."""
        self._check_fitted()
        return {name: getattr(self, f"{name}_") for name in self._chosen}

    def values(self, X: ArrayLike) -> Vector:
        """Returns estimates for queries X, shape (n, d): shape (n,).

        They are not clipped to [0, 1], which would tie the best starts.

        Raises:
            EstimateError: Not fitted yet, or unusable queries.
        """
        return self._values(self._checked(X))

    def value_and_gradient(self, x: ArrayLike) -> tuple[float, Vector]:
        """Returns the unclipped estimate at x, shape (d,), and its gradient, shape (d,)."""
        return self._value_and_gradient(self._checked(np.atleast_2d(x))[0])

    def predict_proba(self, X: ArrayLike) -> Vector:
        """Returns the probabilities of failure and success for queries X, shape (n, 2)."""
        success = np.clip(self.values(X), 0.0, 1.0)
        return np.column_stack([1.0 - success, success])

    def predict(self, X: ArrayLike) -> Vector:
        """Returns the more likely outcome of queries X, 0 or 1, shape (n,)."""
        return (self.values(X) >= 0.5).astype(np.float64)

    @abstractmethod
    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        """Fits to validated rows; see `fit`. `groups` may be None."""

    @abstractmethod
    def _values(self, X: Vector) -> Vector:
        """Returns unclipped estimates for validated queries; see `values`."""

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        """Returns value and gradient at a validated query, here by central differences."""
        h = self.gradient_step * self.scale_
        values = self._values(np.vstack([x, x + np.diag(h), x - np.diag(h)]))
        up, down = np.split(values[1:], 2)
        return float(values[0]), (up - down) / (2.0 * h)

    def _learn(
        self, X: Vector, y: Vector, groups: Any, weight: Vector, solution: Vector | None = None
    ) -> Self:
        self.solution_ = solution
        self._fit(X, y, groups, weight)
        self.classes_ = np.array([0.0, 1.0])
        self.n_features_in_ = X.shape[1]
        self.scale_ = feature_scale(X)
        return self

    def _check_fitted(self) -> None:
        if not hasattr(self, "n_features_in_"):
            raise EstimateError(f"this {type(self).__name__} has no rows yet; call fit(X, y) first")

    def _checked(self, X: ArrayLike) -> Vector:
        self._check_fitted()
        X = np.asarray(X, dtype=np.float64)
        if X.ndim != 2 or X.shape[1] != self.n_features_in_:
            raise EstimateError(f"queries need shape (n, {self.n_features_in_}), got {X.shape}")
        if not np.isfinite(X).all():
            raise EstimateError("queries must be finite, got NaN or infinity; check goal and start")
        return X

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.classifier_tags.multi_class = False
        return tags


@dataclass(eq=False, repr=False)
class SklearnEstimator(SuccessEstimator):
    """A scikit-learn classifier or regressor as a success estimator.

    Attributes:
        model: The unfitted model. A classifier's estimate is its probability of class 1, a
            regressor's its prediction.
        gradient_step: See `SuccessEstimator`; small for a smooth model.
    """

    model: Any
    gradient_step: float = 0.2

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        options = {}
        if np.any(weight != weight[0]):
            if not has_fit_parameter(self.model, "sample_weight"):
                raise EstimateError(
                    f"{type(self.model).__name__} cannot weight its rows, but the library's weights"
                    " differ; choose a model whose fit takes sample_weight"
                )
            options["sample_weight"] = weight
        alike = bool(np.all(y == y[0]))
        model = DummyRegressor() if alike else clone(self.model)
        self.model_ = model.fit(X, y, **options)

    def _values(self, X: Vector) -> Vector:
        if is_classifier(self.model_):
            return np.asarray(self.model_.predict_proba(X)[:, 1], dtype=np.float64)
        return np.asarray(self.model_.predict(X), dtype=np.float64)


from_sklearn = SklearnEstimator
"""Wraps a scikit-learn model; see `SklearnEstimator`."""
