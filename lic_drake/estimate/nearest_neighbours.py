"""K nearest neighbours with Gaussian weights (paper III-D)."""

from collections.abc import Callable
from typing import Any, Self, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from sklearn.base import clone

from lic_drake.errors import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.rows import AveragedRows, average_rows, feature_scale, selection_folds
from lic_drake.seeds import make_generator
from lic_drake.types import BoolVector, IntVector, Vector

_MAX_POINTS = 500
_SEARCH_NEIGHBOURS = 100
# Bandwidths in standard deviations of a feature, from nearest neighbour only to uninformative.
_SMALLEST, _LARGEST = 0.02, 8.0
_COMMON = np.geomspace(0.1, 1.6, 9)
_STEPS = (2.0, 2.0, np.sqrt(2.0))
_DECIMALS = 9


class NearestNeighbours(SuccessEstimator):
    """A Gaussian-weighted average over neighbours.

    Neighbours are distinct feature vectors, each with the mean and number of its reaches. Distances
    d are Euclidean in features divided by their bandwidths, weights exp(-d^2 / 2). Where
    neighbours are sparse the estimate is overconfident: of the PR2's starts with estimates from 0.8
    to 1 (mean 0.87) 0.62 succeeded.

    Attributes:
        neighbours: K, the number of distinct feature vectors averaged.
        bandwidth: Standard deviation of the weights along each feature, shape (d,), in its unit.
            None: those that best predict held-out environments.
        held_out: Matrix A, shape (k, d), or None. Rows with equal A x are held out together instead
            of environments. Needed where a library repeats each (goal, start) pair in several
            environments: copies of the pair in other folds would favour tiny bandwidths.
        bandwidth_: The bandwidths in use.
    """

    def __init__(
        self,
        neighbours: int = 100,
        bandwidth: ArrayLike | None = None,
        held_out: ArrayLike | None = None,
    ) -> None:
        self.neighbours = neighbours
        self.bandwidth = bandwidth
        self.held_out = held_out

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        given = None if self.bandwidth is None else np.asarray(self.bandwidth, dtype=np.float64)
        if self.neighbours < 1 or (given is not None and not np.all(given > 0.0)):
            raise EstimateError(
                "nearest neighbours need 1 or more neighbours and positive bandwidths,"
                f" got {self.neighbours} and {given}"
            )
        rows = average_rows(X, y, weight)
        if given is None:
            if self.held_out is not None:
                common = np.round(X @ np.asarray(self.held_out).T, _DECIMALS) + 0.0
                groups = np.unique(common, axis=0, return_inverse=True)[1].ravel()
            given = select_bandwidths(rows, y, weight, selection_folds(groups, len(y)))
        self.bandwidth_ = given
        self._points = rows.X / given
        self._tree = cKDTree(self._points)
        self._rate, self._count = rows.rate, rows.count

    def _settled(self) -> Self:
        return cast(Self, clone(self).set_params(bandwidth=self.bandwidth_))

    def _values(self, X: Vector) -> Vector:
        distance, index = query_neighbours(self._tree, X / self.bandwidth_, self.neighbours)
        weight = gaussian_weights(distance) * self._count[index]
        values = np.sum(weight * self._rate[index], axis=1) / weight.sum(axis=1)
        return np.clip(values, 0.0, 1.0)  # Outside [0, 1] by rounding only.

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        # For a fixed set of neighbours; the estimate jumps where the set changes.
        query = x / self.bandwidth_
        distance, index = query_neighbours(self._tree, query, self.neighbours)
        weight = gaussian_weights(distance) * self._count[index]
        weight /= weight.sum()
        rate = self._rate[index]
        value = weight @ rate
        pull = (weight * (rate - value)) @ (self._points[index] - query)
        return float(value), pull / self.bandwidth_


def query_neighbours(tree: cKDTree, queries: Vector, neighbours: int) -> tuple[Vector, IntVector]:
    """Returns distances and indices of up to `neighbours` points, shape (..., k), nearest first."""
    return tree.query(queries, k=range(1, min(neighbours, tree.n) + 1))


def gaussian_weights(distance: Vector) -> Vector:
    """Returns exp(-d^2 / 2), scaled to avoid underflow, of distances (..., k), nearest first."""
    return np.exp(-0.5 * (distance**2 - distance[..., :1] ** 2))


def select_bandwidths(rows: AveragedRows, y: Vector, weight: Vector, fold: IntVector) -> Vector:
    """Returns the bandwidth of each feature, shape (d,), from a coordinate-wise search.

    It minimises the squared error in held-out folds, at 500 points at most and with 100 neighbours.

    Args:
        rows: The distinct points.
        y: Success of each reach, shape (n,).
        weight: Number of reaches that each counts as, shape (n,).
        fold: Fold of each reach, shape (n,).
    """
    scale = feature_scale(rows.X)
    if len(rows.X) == 1 or fold.max() == 0:
        return scale  # Nothing can be held out.
    error = _held_out_error(rows, y, weight, fold)
    common = float(min(_COMMON, key=lambda factor: error(factor * scale)))
    return _improve(error, common * scale, scale, np.ptp(rows.X, axis=0) > 0.0)


def _improve(
    error: Callable[[Vector], float], bandwidth: Vector, scale: Vector, varies: BoolVector
) -> Vector:
    """Refines bandwidths along each varying feature, with shrinking steps."""
    least = error(bandwidth)
    for step in _STEPS:
        for feature in np.flatnonzero(varies):
            for factor in (step, 1.0 / step):
                while True:
                    other = bandwidth.copy()
                    other[feature] *= factor
                    inside = _SMALLEST < other[feature] / scale[feature] < _LARGEST
                    if not inside or (found := error(other)) >= least:
                        break
                    bandwidth, least = other, found
    return bandwidth


def _held_out_error(
    rows: AveragedRows, y: Vector, weight: Vector, fold: IntVector
) -> Callable[[Vector], float]:
    """Returns the held-out squared error as a function of the bandwidths."""
    # Numbers of reaches and of successes, each of shape (points, folds).
    shape = (len(rows.X), int(fold.max()) + 1)
    cell = np.ravel_multi_index((rows.member, fold), shape)
    size = shape[0] * shape[1]
    tries = np.bincount(cell, weights=weight, minlength=size).reshape(shape)
    successes = np.bincount(cell, weights=weight * y, minlength=size).reshape(shape)
    # Each fold is predicted from all others.
    seen_tries = tries.sum(axis=1, keepdims=True) - tries
    seen_successes = successes.sum(axis=1, keepdims=True) - successes
    rate = seen_successes.sum() / seen_tries.sum()
    rng = make_generator("training", "points for the choice of a bandwidth")
    tried = rng.permutation(len(rows.X))[:_MAX_POINTS]
    misses, hits = tries[tried] - successes[tried], successes[tried]

    def error(bandwidth: Vector) -> float:
        points = rows.X / bandwidth
        distance, index = query_neighbours(cKDTree(points), points[tried], _SEARCH_NEIGHBOURS)
        kernel = csr_array(
            (
                gaussian_weights(distance).ravel(),
                index.ravel(),
                np.arange(0, index.size + 1, index.shape[1]),
            ),
            shape=(len(tried), len(points)),
        )
        total = kernel @ seen_tries
        # Where all neighbours are held out, predict the overall rate.
        known = total > 0.0
        predicted = np.where(known, kernel @ seen_successes / np.where(known, total, 1.0), rate)
        return float(np.sum(hits * (1.0 - predicted) ** 2 + misses * predicted**2))

    return error
