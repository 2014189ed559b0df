"""Success surfaces with known shapes, in the place of fitted estimators."""

import numpy as np
from numpy.typing import NDArray

from lic_drake.estimate.estimator import Prediction

Vector = NDArray[np.float64]


class Bumps:
    """A sum of Gaussian bumps over z = (goal_x, goal_y, y, phi), the first ones over (y, phi)."""

    def __init__(self, centres: Vector, heights: Vector, width: Vector) -> None:
        self.centres, self.heights, self.width = centres, heights, width

    def fit(self, Z: Vector, f: Vector, environment: Vector | None = None) -> "Bumps":
        return self

    def predict(self, Z: Vector) -> Prediction:
        values = np.array([self.value_and_gradient(z)[0] for z in Z])
        return Prediction(probability=np.clip(values, 0.0, 1.0), spread=np.zeros(len(Z)))

    def value_and_gradient(self, z: Vector) -> tuple[float, Vector]:
        d = (z[2:] - self.centres) / self.width
        terms = self.heights * np.exp(-0.5 * np.sum(d**2, axis=1))
        gradient = np.zeros(len(z))
        gradient[2:] = -(terms[:, None] * d / self.width).sum(axis=0)
        return float(terms.sum()), gradient


def random_bumps(seed: int, count: int = 4) -> Bumps:
    rng = np.random.default_rng(seed)
    return Bumps(
        rng.uniform([-0.4, -0.6], [0.4, 1.6], size=(count, 2)),
        rng.uniform(0.3, 0.9, size=count),
        np.array([0.15, 0.5]),
    )
