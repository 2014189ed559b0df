"""Estimators of scikit-learn behind our interface, to compare ours with; they give no gradient."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.estimate.averaging import average_rows, reach_variance
from lic_drake.estimate.checks import (
    EstimateError,
    checked_queries,
    checked_rows,
    feature_scale,
)
from lic_drake.estimate.estimator import Prediction


class ScikitNeighbours:
    """`KNeighborsClassifier` on raw rows with standardised features; satisfies `Predictor`.

    The spread is that of a rate among K independent reaches.

    Attributes:
        neighbours: K, the number of reaches averaged, with equal weights.
    """

    def __init__(self, *, neighbours: int) -> None:
        self.neighbours = neighbours
        self._model: Any = None

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        from sklearn.neighbors import KNeighborsRegressor
        return self
