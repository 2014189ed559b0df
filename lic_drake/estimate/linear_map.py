"""An estimator that looks at other features than those it is asked with: their linear combinations.

Whether the PR2 comes to a goal depends first of all on how far the goal lies aside of the aperture
through which it reaches. A kernel with a scale for each feature can say so only if this difference
is a feature: from goals 0.2 m apart, those held out are then predicted better
(notebooks/results/ablation/space_features.md).
"""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.estimate.checks import EstimateError, Vector, checked_queries, checked_rows
from lic_drake.estimate.estimator import Prediction, SuccessEstimator
from lic_drake.estimate.features import FeatureMap

_DECIMALS = 9
"""Sums of the same numbers in another order are the same features again, metres."""


class MappedEstimator:
    """Hands M z to another estimator; satisfies `SuccessEstimator`.

    Attributes:
        inner: The other estimator.
        matrix: M, shape (k, d).
    """

    def __init__(self, inner: SuccessEstimator, matrix: Vector) -> None:
        self.inner = inner
        self.matrix = matrix

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        self.inner.fit(self._map(Z), f, environment)
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        return self.inner.predict(self._map(Z))

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the other's estimates for queries Z, shape (n, d): shape (n,)."""
        return self.inner.values(self._map(Z))

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the other's value at z, shape (d,), and its gradient by z."""
        value, by_mapped = self.inner.value_and_gradient(self._map(np.atleast_2d(z))[0])
        return value, self.matrix.T @ by_mapped

    def _map(self, Z: ArrayLike) -> Vector:
        mapped: Vector = np.round(
            checked_queries(Z, self.matrix.shape[1]) @ self.matrix.T, _DECIMALS
        )
        return mapped


def can_be_relative(features: FeatureMap) -> bool:
    """Tells whether features are those of a robot in space, as `relative_features` needs them."""
    needed = {f"{name}_{axis}" for name in ("goal", "start") for axis in "yz"}
    if features.observed:
        needed |= {"first_start_y", "first_start_z"}
    return features.in_space and needed <= set(features.names)


def relative_features(features: FeatureMap) -> tuple[Vector, slice]:
    """Returns the matrix M of a PR2's features, and which of M z the situation decides.

    M z is, of the goal G, the start E and, for LIC-2, the failed start F, across x in R: G - F and
    F, where there is one, and then E - G and E. The roll is left out: where the aperture is says
    which one the arm takes.

    Raises:
        EstimateError: The features lack one of these.
    """
    names, rows = features.names, []

    def take(plus: str, minus: str | None = None) -> None:
        for axis in "yz":
            row = np.zeros(len(names))
            for name, sign in ((plus, 1.0), (minus, -1.0)):
                if name is None:
                    continue
                if f"{name}_{axis}" not in names:
                    raise EstimateError(f"features across x need {name}_{axis}, got {names}")
                row[names.index(f"{name}_{axis}")] = sign
            rows.append(row)

    if features.observed:
        take("goal", "first_start")
        take("first_start")
    situation = slice(0, len(rows))
    take("start", "goal")
    take("start")
    return np.array(rows), situation
