"""An estimator that looks at other features than those it is asked with: their linear combinations.

Whether the PR2 comes to a goal depends first of all on how far the goal lies aside of the aperture
through which it reaches. A kernel with a scale for each feature can say so only if this difference
is a feature: from goals 0.2 m apart, those held out are then predicted better, and the process's
chosen start succeeds in 183 of 480 cases instead of 163
(notebooks/results/ablation/space_features.md).
"""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.estimate.checks import checked_queries, checked_rows
from lic_drake.estimate.estimator import Prediction, UpdatableEstimator
from lic_drake.estimate.features import FeatureMap
from lic_drake.types import Vector

_DECIMALS = 9
"""Sums of the same numbers in another order are the same features again, metres."""


class MappedEstimator:
    """Hands M z to another estimator; satisfies `UpdatableEstimator`.

    Attributes:
        inner: The other estimator.
        matrix: M, shape (k, d).
        held_out: The part of z of which the other holds out whole values, instead of whole
            environments, where it chooses its settings. For a library that tries each pair of goal
            and start in several environments: without one of them the pair is still there, and
            bandwidths that see nothing but the pair itself win.
    """

    def __init__(
        self, inner: UpdatableEstimator, matrix: Vector, held_out: slice | None = None
    ) -> None:
        self.inner = inner
        self.matrix = matrix
        self.held_out = held_out

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        if self.held_out is not None:
            values = np.round(Z[:, self.held_out], _DECIMALS)
            environment = np.unique(values, axis=0, return_inverse=True)[1].ravel()
        self.inner.fit(self._map(Z), f, environment)
        return self

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows in; see `UpdatableEstimator`."""
        Z, f = checked_rows(Z, f)
        self.inner.update(self._map(Z), f, weight)
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
    return features.in_space and needed <= set(features.names)


def relative_features(features: FeatureMap) -> Vector:
    """Returns the matrix M of a PR2's features, shape (4, d).

    M z is, of the goal G and the start E, E - G and E, across x in R. The roll is left out: where
    the aperture is says which one the arm takes.
    """
    return np.array(
        [
            *(features_apart(features, "start", "goal")),
            *(_one(features, f"start_{axis}") for axis in "yz"),
        ]
    )


def features_apart(features: FeatureMap, one: str, other: str) -> Vector:
    """Returns the matrix that takes z to the place of one thing from another, across x.

    Args:
        features: What z means.
        one: "goal", "start" or "first_start".
        other: The same.

    Returns:
        Shape (2, d).
    """
    return np.array(
        [_one(features, f"{one}_{axis}") - _one(features, f"{other}_{axis}") for axis in "yz"]
    )


def _one(features: FeatureMap, name: str) -> Vector:
    row: Vector = (np.array(features.names) == name).astype(float)
    return row
