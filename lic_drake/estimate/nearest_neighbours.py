"""K nearest neighbours with Gaussian weights (paper III-D)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lic_drake.estimate.averaging import AveragedRows, average_rows
from lic_drake.estimate.bandwidth import gaussian_weights, query_neighbours, select_bandwidths
from lic_drake.estimate.checks import EstimateError, checked_queries, checked_rows, checked_weights
from lic_drake.estimate.estimator import Prediction
from lic_drake.estimate.folds import selection_folds
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class _Points:
    """Distinct feature vectors, also divided by the bandwidths, with success rates and counts."""

    tree: cKDTree
    Z: Vector
    points: Vector
    rate: Vector
    count: Vector


class NearestNeighbours:
    """A Gaussian-weighted average over neighbours; satisfies `SuccessEstimator`.

    Neighbours are distinct feature vectors, each with the mean and the number of its reaches:
    among raw rows a tie at the K-th place would let the order of rows choose environments.
    Distances d are Euclidean in features divided by their bandwidths, weights exp(-d^2 / 2).

    The spread is the standard deviation of the weighted average if each reach is an independent
    draw (Kish's effective sample size, Jeffreys' prior). It knows nothing of the luck that
    reaches in one environment share, nor of the bias that averaging over neighbours brings. Where
    neighbours are sparse the estimate is too sure of itself: among the PR2's starts that it gave
    0.8 to 1 (mean 0.87) 0.62 succeeded.

    Attributes:
        neighbours: K, the number of distinct feature vectors averaged.
    """

    def __init__(self, *, neighbours: int = 100, bandwidth: ArrayLike | None = None) -> None:
        """Sets up an estimator.

        Args:
            neighbours: See the class.
            bandwidth: Standard deviation of the weights along each feature, shape (d,), in its
                unit. By default `fit` takes those that best predict environments that were held
                out.

        Raises:
            EstimateError: K below 1, or a bandwidth that is not positive.
        """
        given = None if bandwidth is None else np.asarray(bandwidth, dtype=float)
        if neighbours < 1 or (given is not None and not np.all(given > 0.0)):
            raise EstimateError(
                "nearest neighbours need 1 or more neighbours and positive bandwidths,"
                f" got {neighbours} and {given}"
            )
        self.neighbours = neighbours
        self._given = given
        self._chosen = given
        self._points: _Points | None = None

    @property
    def bandwidth(self) -> Vector:
        """The bandwidths in use, shape (d,), in the units of the features.

        Raises:
            EstimateError: Neither given nor fitted yet.
        """
        if self._chosen is None:
            raise EstimateError("the bandwidth is not chosen yet; call fit(Z, f) first")
        return self._chosen

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        rows = average_rows(Z, f)
        if self._given is None:
            fold = selection_folds(environment, len(f))
            self._chosen = select_bandwidths(rows, f, fold)
        self._points = _index(rows, self.bandwidth)
        return self

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows in; see `UpdatableEstimator`.

        A row of weight w counts as w reaches: its kernel weight is multiplied by w. Bandwidths
        stay.
        """
        at = self._fitted()
        Z, f = checked_rows(Z, f)
        checked_queries(Z, at.points.shape[1])
        counts = np.concatenate([at.count, checked_weights(weight, len(f))])
        rates = np.concatenate([at.rate, f])
        self._points = _index(average_rows(np.vstack([at.Z, Z]), rates, counts), self.bandwidth)
        return self

    def conditioned_on(
        self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0
    ) -> "NearestNeighbours":
        """Returns neighbours with these bandwidths among other rows only."""
        other = NearestNeighbours(neighbours=self.neighbours, bandwidth=self.bandwidth)
        Z, f = checked_rows(Z, f)
        rows = average_rows(Z, f, checked_weights(weight, len(f)))
        other._points = _index(rows, self.bandwidth)
        return other

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        at = self._fitted()
        queries = checked_queries(Z, at.points.shape[1]) / self.bandwidth
        distance, index = query_neighbours(at.tree, queries, self.neighbours)
        weight = gaussian_weights(distance)
        weighted_count = weight * at.count[index]
        total = weighted_count.sum(axis=1)
        probability = np.sum(weighted_count * at.rate[index], axis=1) / total
        sample_size = total**2 / np.sum(weight * weighted_count, axis=1)
        p = (sample_size * probability + 0.5) / (sample_size + 1.0)
        return Prediction(
            probability=np.clip(probability, 0.0, 1.0),
            spread=np.sqrt(p * (1.0 - p) / sample_size),
        )

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the weighted averages at queries Z, shape (n, d): shape (n,)."""
        return self.predict(Z).probability

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the weighted average at z, shape (d,), and its gradient.

        Both belong to the neighbours at hand: the estimate is smooth while these stay the same
        and has a small jump where they change.
        """
        at = self._fitted()
        query = checked_queries(np.atleast_2d(z), at.points.shape[1])[0] / self.bandwidth
        distance, index = query_neighbours(at.tree, query, self.neighbours)
        weight = gaussian_weights(distance) * at.count[index]
        weight /= weight.sum()
        rate = at.rate[index]
        value = weight @ rate
        pull = (weight * (rate - value)) @ (at.points[index] - query)
        return float(value), pull / self.bandwidth

    def _fitted(self) -> _Points:
        if self._points is None:
            raise EstimateError("the nearest neighbours have no rows yet; call fit(Z, f) first")
        return self._points


def _index(rows: AveragedRows, bandwidth: Vector) -> _Points:
    points = rows.Z / bandwidth
    return _Points(tree=cKDTree(points), Z=rows.Z, points=points, rate=rows.rate, count=rows.count)
