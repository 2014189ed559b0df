"""Estimators of scikit-learn behind our interface, to compare ours with; they give no gradient."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.estimate.averaging import average_rows, reach_variance
from lic_drake.estimate.checks import EstimateError, checked_queries, checked_rows, feature_scale
from lic_drake.estimate.estimator import Prediction, Predictor
from lic_drake.types import Vector


@dataclass(kw_only=True)
class ScikitRegressor:
    """A regressor of scikit-learn on standardised features; satisfies `Predictor`.

    It knows no environments, and its spread is NaN: scikit-learn gives none for neighbours.

    Attributes:
        make: Returns an unfitted regressor for d features and rows with these noise variances,
            shape (m,).
        average: Whether rows of the same features are averaged first.
    """

    make: Callable[[int, Vector], Any]
    average: bool
    _model: Any = field(default=None, init=False)
    _scale: Vector = field(default_factory=lambda: np.ones(0), init=False)

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        rows = average_rows(Z, f)
        noise = np.full(len(f), reach_variance(rows))
        if self.average:
            Z, f, noise = rows.Z, rows.rate, reach_variance(rows) / rows.count
        self._scale = feature_scale(Z)
        self._model = self.make(Z.shape[1], noise).fit(Z / self._scale, f)
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        if self._model is None:
            raise EstimateError("the regressor has no rows yet; call fit(Z, f) first")
        Z = checked_queries(Z, len(self._scale)) / self._scale
        probability = np.clip(self._model.predict(Z), 0.0, 1.0)
        return Prediction(probability=probability, spread=np.full(len(Z), np.nan))


def _neighbours(k: int) -> Predictor:
    def make(num_features: int, noise_variance: Vector) -> Any:
        from sklearn.neighbors import KNeighborsRegressor

        return KNeighborsRegressor(n_neighbors=min(k, len(noise_variance)))

    return ScikitRegressor(make=make, average=False)


def _gaussian_process() -> Predictor:
    def make(num_features: int, noise_variance: Vector) -> Any:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern

        # The first constant is the prior variance of the unknown mean rate.
        kernel = ConstantKernel(1.0, "fixed") + ConstantKernel(0.05, (1e-4, 4.0)) * Matern(
            np.ones(num_features), nu=0.5
        )
        return GaussianProcessRegressor(kernel, alpha=noise_variance)

    return ScikitRegressor(make=make, average=True)


PEERS: dict[str, Callable[[], Predictor]] = {
    "sklearn KNN, K=5": lambda: _neighbours(5),
    "sklearn KNN, K=100": lambda: _neighbours(100),
    "sklearn GP, Matern 1/2": _gaussian_process,
}
"""Name -> new, unfitted predictor. On successes of 0 and 1 the neighbours' regressor gives what
`KNeighborsClassifier.predict_proba` gives; K=5 is the default of both."""
