"""An estimator of your own: gradient-boosted trees of scikit-learn, with a numerical gradient."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.estimate import checks
from lic_drake.estimate.estimator import Prediction
from lic_drake.estimate.registry import register_estimator
from lic_drake.types import Vector


class GradientBoosting:
    """P(success) as the probability of a gradient-boosted classifier; a `SuccessEstimator`.

    Trees are flat between their steps, so that their own gradient is zero. The central difference
    over `step` standard deviations of a feature is the exact slope of the estimate averaged along
    that feature over the same width, which is what the optimiser climbs.
    """

    def __init__(self, step: float = 0.2) -> None:
        self.step = step
        self._model: Any = None
        self._scale: Vector = np.ones(0)

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,)."""
        from sklearn.ensemble import HistGradientBoostingClassifier

        Z, f = checks.checked_rows(Z, f)
        if np.all(f == f[0]):
            raise checks.EstimateError("all reaches ended alike; trees need successes and failures")
        leaf = max(2, min(20, len(f) // 20))
        model = HistGradientBoostingClassifier(max_iter=60, min_samples_leaf=leaf, random_state=0)
        self._model, self._scale = model.fit(Z, f), checks.feature_scale(Z)
        return self

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the estimates at queries Z, shape (n, d): shape (n,)."""
        if self._model is None:
            raise checks.EstimateError("the trees have no rows yet; call fit(Z, f) first")
        Z = checks.checked_queries(Z, len(self._scale))
        return np.asarray(self._model.predict_proba(Z)[:, 1])

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) at Z; the spread is that of a single reach."""
        p = self.values(Z)
        return Prediction(probability=p, spread=np.sqrt(p * (1.0 - p)))

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the estimate at z, shape (d,), and its gradient."""
        z, h = np.asarray(z, dtype=float), np.diag(self.step * self._scale)
        values = self.values(np.vstack([z, z + h, z - h]))
        up, down = np.split(values[1:], 2)
        return float(values[0]), (up - down) / (2.0 * np.diag(h))


register_estimator("boosting", lambda features: GradientBoosting())
