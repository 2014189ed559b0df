"""LIC-2 for robots whose failures tell little but that the first choice was wrong.

Behind a board nearly all of a reach's fate is decided by where aperture and goal are, and the same
pairs recur in D2 a few hundred times. Local rows of D2 then cover two or three goals: from goals
that were held out the process found 6 of 32 possible second starts with them, and 15 with LIC-1's
estimate as a feature. LIC-1 away from the failed start found 20. Where the failed start could be
chosen again, the process would do so after 162 of 297 failures
(notebooks/results/ablation/space_features.md).
"""

from collections.abc import Callable
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.checks import EstimateError, checked_queries, checked_rows, checked_weights
from lic_drake.estimate.estimator import Prediction, UpdatableEstimator
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

MAX_ROWS = 2000
"""So many random rows of D2 tell how an estimate and a failure add up; two features and a few
length scales ask for no more."""


class StackedEstimator:
    """Estimates without the failure first, then what the failure changes.

    The second stage sees the first one's estimate and the start's place from the failed one. Both
    learn from D2: every row is also a first reach. Satisfies `UpdatableEstimator`; the spread is
    that of the second stage.

    Attributes:
        alone: Columns of z without the failure.
        matrix: Takes z to the start's place from the failed one, shape (k, d).
    """

    def __init__(
        self,
        make_first: Callable[[], UpdatableEstimator],
        make_second: Callable[[], UpdatableEstimator],
        alone: NDArray[np.intp],
        matrix: Vector,
    ) -> None:
        """Sets up an estimator.

        Args:
            make_first: Returns the estimator of the first stage, unfitted.
            make_second: Returns that of the second.
            alone: See the class.
            matrix: See the class.
        """
        self.alone = alone
        self.matrix = matrix
        self._make = make_first, make_second
        self._stages: tuple[UpdatableEstimator, UpdatableEstimator] | None = None

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from rows of D2; see `Predictor`."""
        Z, f = checked_rows(Z, f)
        known = np.zeros(len(f)) if environment is None else np.asarray(environment, dtype=float)
        if known.shape != f.shape:
            raise EstimateError(f"{len(f)} rows need as many environments, got {known.shape}")
        # A reach is in D2 once for every failure before it.
        reaches = np.unique(np.column_stack([known, f, Z[:, self.alone]]), axis=0)
        first = self._make[0]().fit(reaches[:, 2:], reaches[:, 1], reaches[:, 0])
        rng = make_generator("training", "rows of the second stage")
        part = np.sort(rng.permutation(len(f))[:MAX_ROWS])
        second = self._make[1]().fit(self._second_features(first, Z[part]), f[part], known[part])
        self._stages = first, second
        return self

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows of D2 in; see `UpdatableEstimator`.

        The first stage takes each reach in once, however many failures go before it.
        """
        first, second = self._fitted()
        Z, f = checked_rows(Z, f)
        weights = checked_weights(weight, len(f))
        reaches = np.unique(np.column_stack([f, weights, self._checked(Z)[:, self.alone]]), axis=0)
        first.update(reaches[:, 2:], reaches[:, 0], reaches[:, 1])
        second.update(self._second_features(first, Z), f, weights)
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        first, second = self._fitted()
        return second.predict(self._second_features(first, self._checked(Z)))

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the estimates for queries Z, shape (n, d): shape (n,)."""
        first, second = self._fitted()
        return second.values(self._second_features(first, self._checked(Z)))

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the estimate at z, shape (d,), and its gradient by z."""
        first, second = self._fitted()
        query = self._checked(np.atleast_2d(z))[0]
        estimate, by_alone = first.value_and_gradient(query[self.alone])
        value, by_stage = second.value_and_gradient(np.append(estimate, self.matrix @ query))
        gradient: Vector = self.matrix.T @ by_stage[1:]
        gradient[self.alone] += by_stage[0] * by_alone
        return value, gradient

    def _second_features(self, first: UpdatableEstimator, Z: Vector) -> Vector:
        return np.column_stack([first.values(Z[:, self.alone]), Z @ self.matrix.T])

    def _checked(self, Z: ArrayLike) -> Vector:
        return checked_queries(Z, self.matrix.shape[1])

    def _fitted(self) -> tuple[UpdatableEstimator, UpdatableEstimator]:
        if self._stages is None:
            raise EstimateError("the stacked estimator has no rows yet; call fit(Z, f) first")
        return self._stages
