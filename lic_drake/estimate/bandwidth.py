"""Gaussian weights of nearest neighbours, and how wide they should be along each feature."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lic_drake.estimate.averaging import AveragedRows
from lic_drake.estimate.checks import feature_scale
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

_MAX_POINTS = 500
_NEIGHBOURS = 100
# Bandwidths in standard deviations of their feature: from nearest neighbours only to a feature
# that tells nothing.
_SMALLEST, _LARGEST = 0.02, 8.0
_COMMON = np.geomspace(0.1, 1.6, 9)
_STEPS = (2.0, 2.0, np.sqrt(2.0))


def query_neighbours(
    tree: cKDTree, queries: Vector, neighbours: int
) -> tuple[Vector, NDArray[np.intp]]:
    """Returns distances and indices of the nearest points, shape (..., k), nearest first.

    k is `neighbours`, or the number of points if there are fewer.
    """
    k = min(neighbours, tree.n)
    distance, index = tree.query(queries, k=k)
    if k == 1:  # the tree then leaves out the axis of neighbours
        return np.expand_dims(distance, -1), np.expand_dims(index, -1)
    return distance, index


def gaussian_weights(distance: Vector) -> Vector:
    """Returns exp(-d^2 / 2) relative to the nearest, so that not all of them underflow.

    Args:
        distance: Distances d in bandwidths, shape (..., k), the nearest first.
    """
    nearest = distance[..., :1]
    weights: Vector = np.exp(-0.5 * (distance**2 - nearest**2))
    return weights


def select_bandwidths(rows: AveragedRows, f: Vector, fold: NDArray[np.intp]) -> Vector:
    """Returns the bandwidth of each feature, shape (d,), by search along one after the other.

    Sought is the least squared error in folds that were held out, at 500 points at most and with
    100 neighbours. Where features matter differently, as a start's orientation and a goal's
    distance do, a common bandwidth in standard deviations averages too much along one and too
    little along the other.

    Args:
        rows: The distinct points.
        f: Success of each reach, shape (n,).
        fold: Fold of each reach, shape (n,).
    """
    scale = feature_scale(rows.Z)
    if len(rows.Z) == 1 or fold.max() == 0:
        return scale  # Nothing can be held out.
    error = _held_out_error(rows, f, fold)
    common = float(min(_COMMON, key=lambda factor: error(factor * scale)))
    return _improve(error, common * scale, scale, np.ptp(rows.Z, axis=0) > 0.0)


def _improve(
    error: Callable[[Vector], float],
    bandwidth: Vector,
    scale: Vector,
    varies: NDArray[np.bool_],
) -> Vector:
    """Returns bandwidths after a search along each varying feature, with shrinking steps."""
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
    rows: AveragedRows, f: Vector, fold: NDArray[np.intp]
) -> Callable[[Vector], float]:
    """Returns the squared error as a function of the bandwidths."""
    tries, successes = _count_by_fold(len(rows.Z), rows.member, f, fold)
    # What each fold is predicted from: everything but itself.
    seen_tries = tries.sum(axis=1, keepdims=True) - tries
    seen_successes = successes.sum(axis=1, keepdims=True) - successes
    rate = seen_successes.sum() / seen_tries.sum()
    rng = make_generator("training", "points for the choice of a bandwidth")
    tried = rng.permutation(len(rows.Z))[:_MAX_POINTS]
    misses, hits = tries[tried] - successes[tried], successes[tried]

    def error(bandwidth: Vector) -> float:
        points = rows.Z / bandwidth
        distance, index = query_neighbours(cKDTree(points), points[tried], _NEIGHBOURS)
        weight = csr_array(
            (
                gaussian_weights(distance).ravel(),
                index.ravel(),
                np.arange(0, index.size + 1, index.shape[1]),
            ),
            shape=(len(tried), len(points)),
        )
        total = weight @ seen_tries
        # Where a fold holds all neighbours, the rate of the other folds is all there is.
        known = total > 0.0
        predicted = np.where(known, weight @ seen_successes / np.where(known, total, 1.0), rate)
        return float(np.sum(hits * (1.0 - predicted) ** 2 + misses * predicted**2))

    return error


def _count_by_fold(
    num_points: int, point: NDArray[np.intp], f: Vector, fold: NDArray[np.intp]
) -> tuple[Vector, Vector]:
    """Returns numbers of reaches and of successes, each of shape (points, folds)."""
    shape = (num_points, int(fold.max()) + 1)
    cell = np.ravel_multi_index((point, fold), shape)
    size = shape[0] * shape[1]
    tries = np.bincount(cell, minlength=size).reshape(shape).astype(float)
    successes = np.bincount(cell, weights=f, minlength=size).reshape(shape)
    return tries, successes
