"""Gaussian weights of nearest neighbours, and how wide they should be."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from lic_drake.estimate.checks import Vector
from lic_drake.seeds import make_generator

_MAX_POINTS = 2000
_NUM_CANDIDATES = 16
# A neighbour at this many bandwidths weighs 1/23 of one at hand: where the set of neighbours
# changes, the estimate then jumps by little.
_TRUNCATION = 2.5


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


def gaussian_weights(distance: Vector, bandwidth: float) -> Vector:
    """Returns exp(-d^2 / (2 h^2)) relative to the nearest, so that not all of them underflow.

    Args:
        distance: Distances d, shape (..., k), the nearest first.
        bandwidth: h, in the same unit.
    """
    nearest = distance[..., :1]
    weights: Vector = np.exp(-0.5 * (distance**2 - nearest**2) / bandwidth**2)
    return weights


def select_bandwidth(
    tree: cKDTree, neighbours: int, point: NDArray[np.intp], f: Vector, fold: NDArray[np.intp]
) -> float:
    """Returns the bandwidth with the least squared error in folds that were held out.

    Args:
        tree: The distinct points; at most 2,000 of them are tried.
        neighbours: Number of points averaged.
        point: Point of each reach, shape (n,).
        f: Success of each reach, shape (n,).
        fold: Fold of each reach, shape (n,).
    """
    if min(neighbours, tree.n) == 1:
        return 1.0  # a single neighbour weighs the same at any bandwidth
    tries, successes = _count_by_fold(tree.n, point, f, fold)
    # What each fold is predicted from: everything but itself.
    seen_tries = tries.sum(axis=1, keepdims=True) - tries
    seen_successes = successes.sum(axis=1, keepdims=True) - successes
    rate = seen_successes.sum() / seen_tries.sum()

    rng = make_generator("training", "points for the choice of a bandwidth")
    tried = rng.permutation(tree.n)[:_MAX_POINTS]
    distance, index = query_neighbours(tree, tree.data[tried], neighbours)
    row_starts = np.arange(0, index.size + 1, index.shape[1])
    smallest = 0.5 * float(np.median(distance[:, 1]))
    largest = max(smallest, float(np.median(distance[:, -1])) / _TRUNCATION)

    def error(bandwidth: float) -> float:
        weight = csr_array(
            (gaussian_weights(distance, bandwidth).ravel(), index.ravel(), row_starts),
            shape=(len(tried), tree.n),
        )
        total = weight @ seen_tries
        # Where a fold holds all neighbours, the rate of the other folds is all there is.
        known = total > 0.0
        predicted = np.where(known, weight @ seen_successes / np.where(known, total, 1.0), rate)
        hits = successes[tried]
        return float(np.sum(hits * (1.0 - predicted) ** 2 + (tries[tried] - hits) * predicted**2))

    return float(min(np.geomspace(smallest, largest, _NUM_CANDIDATES), key=error))


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
