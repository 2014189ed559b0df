"""Success surfaces with known shapes, in the place of fitted estimators."""

import numpy as np

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.select.objective import SuccessModel
from lic_drake.types import Vector


class Bumps(SuccessEstimator):
    """A sum of Gaussian bumps over the last features of x, in PLANAR_LIC1 over (y, phi)."""

    def __init__(self, centres: Vector, heights: Vector, width: Vector) -> None:
        self.centres, self.heights, self.width = centres, heights, width

    def values(self, X: Vector) -> Vector:
        return self._values(np.asarray(X))

    def value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        d = (x[-len(self.width) :] - self.centres) / self.width
        terms = self.heights * np.exp(-0.5 * np.sum(d**2, axis=1))
        gradient = np.zeros(len(x))
        gradient[-len(self.width) :] = -(terms[:, None] * d / self.width).sum(axis=0)
        return float(terms.sum()), gradient

    def _fit(self, X: Vector, y: Vector, groups: object, weight: Vector) -> None:
        """Knows everything already."""

    def _values(self, X: Vector) -> Vector:
        d = (X[:, None, -len(self.width) :] - self.centres) / self.width
        values: Vector = np.exp(-0.5 * np.sum(d**2, axis=2)) @ self.heights
        return values


def random_bumps(seed: int, count: int = 4) -> Bumps:
    rng = np.random.default_rng(seed)
    return Bumps(
        rng.uniform([-0.4, -0.6], [0.4, 1.6], size=(count, 2)),
        rng.uniform(0.3, 0.9, size=count),
        np.array([0.15, 0.5]),
    )


# By the last part of a feature's name: from where to where it goes, and how wide a bump is.
_RANGES = {
    "x": (0.4, 0.8, 0.3),
    "y": (-0.4, 0.4, 0.25),
    "phi": (-0.7, 1.6, 0.6),
    "z": (0.5, 1.1, 0.25),
    "qx": (-0.8, 0.8, 0.5),
    "vx": (-0.2, 0.2, 0.2),
    "vy": (-0.2, 0.2, 0.2),
    "vz": (-0.2, 0.2, 0.2),
}


def random_model(seed: int, features: FeatureMap = PLANAR_LIC1, count: int = 5) -> SuccessModel:
    """A model whose estimate depends on every one of its features."""
    rng = np.random.default_rng(seed)
    low, high, width = np.array([_RANGES[name.split("_")[-1]] for name in features.columns]).T
    bumps = Bumps(rng.uniform(low, high, (count, len(low))), rng.uniform(0.4, 0.9, count), width)
    return SuccessModel(estimator=bumps, features=features)
