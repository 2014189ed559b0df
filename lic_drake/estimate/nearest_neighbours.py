"""K nearest neighbours with Gaussian weights (paper III-D)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from lic_drake.estimate.averaging import AveragedRows, average_rows
from lic_drake.estimate.checks import (
    EstimateError,
    Vector,
    checked_queries,
    checked_rows,
    feature_scale,
)
from lic_drake.estimate.estimator import Prediction
from lic_drake.seeds import make_generator

_MAX_SELECTION_POINTS = 2000
_NUM_BANDWIDTHS = 16
# A neighbour at this many bandwidths weighs 1/23 of one at hand: where the set of neighbours
# changes, the estimate then jumps by little.
_TRUNCATION = 2.5


@dataclass(frozen=True, kw_only=True)
class _Fitted:
    """Distinct points in units of `scale`, with their rates and counts."""

    tree: cKDTree
    points: Vector
    rate: Vector
    count: Vector
    scale: Vector
    bandwidth: float


class NearestNeighbours:
    """A Gaussian-weighted average over neighbours; satisfies `SuccessEstimator`.

    Neighbours are distinct feature vectors, each with the mean and the number of its reaches:
    among raw rows a tie at the K-th place would let the order of rows choose environments.
    Distances are Euclidean in features divided by their standard deviation.

    The spread is the standard deviation of the weighted average if each reach is an independent
    draw (Kish's effective sample size, Jeffreys' prior); it knows nothing of the bias that
    averaging over neighbours brings.

    Attributes:
        neighbours: K, the number of distinct feature vectors averaged.
    """

    def __init__(self, *, neighbours: int = 200, bandwidth: float | None = None) -> None:
        """Sets up an estimator.

        Args:
            neighbours: See the class.
            bandwidth: Standard deviation h of the weights exp(-d^2 / (2 h^2)), in standard
                deviations of the features. By default `fit` takes the one that predicts each
                distinct point best from the others: selected starts lie between grid points.

        Raises:
            EstimateError: K below 1, or a bandwidth that is not positive.
        """
        if neighbours < 1 or (bandwidth is not None and not bandwidth > 0.0):
            raise EstimateError(
                "nearest neighbours need 1 or more neighbours and a positive bandwidth,"
                f" got {neighbours} and {bandwidth}"
            )
        self.neighbours = neighbours
        self._given = bandwidth
        self._model: _Fitted | None = None

    @property
    def bandwidth(self) -> float:
        """The bandwidth in use.

        Raises:
            EstimateError: Not fitted yet.
        """
        return self._fitted().bandwidth

    def fit(self, Z: ArrayLike, f: ArrayLike) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); returns itself."""
        rows = average_rows(*checked_rows(Z, f))
        scale = feature_scale(rows.Z)
        points = rows.Z / scale
        tree = cKDTree(points)
        self._model = _Fitted(
            tree=tree,
            points=points,
            rate=rows.rate,
            count=rows.count,
            scale=scale,
            bandwidth=self._given or select_bandwidth(tree, rows, self.neighbours),
        )
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `SuccessEstimator`."""
        model = self._fitted()
        queries = checked_queries(Z, len(model.scale)) / model.scale
        distance, index = model.tree.query(queries, k=self._neighbour_ranks())
        weight = _weights(distance, model.bandwidth)
        weighted_count = weight * model.count[index]
        total = weighted_count.sum(axis=1)
        probability = np.sum(weighted_count * model.rate[index], axis=1) / total
        sample_size = total**2 / np.sum(weight * weighted_count, axis=1)
        p = (sample_size * probability + 0.5) / (sample_size + 1.0)
        return Prediction(
            probability=np.clip(probability, 0.0, 1.0),
            spread=np.sqrt(p * (1.0 - p) / sample_size),
        )

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the weighted average at z, shape (d,), and its gradient.

        Both belong to the neighbours at hand: the estimate is smooth while these stay the same
        and has a small jump where they change.
        """
        model = self._fitted()
        query = checked_queries(np.atleast_2d(z), len(model.scale))[0] / model.scale
        distance, index = model.tree.query(query, k=self._neighbour_ranks())
        weight = _weights(distance, model.bandwidth) * model.count[index]
        weight /= weight.sum()
        rate = model.rate[index]
        value = weight @ rate
        pull = (weight * (rate - value)) @ (model.points[index] - query)
        return float(value), pull / (model.bandwidth**2 * model.scale)

    def _neighbour_ranks(self) -> list[int]:
        # As a list the tree returns an axis of neighbours even for one of them.
        return list(range(1, min(self.neighbours, len(self._fitted().rate)) + 1))

    def _fitted(self) -> _Fitted:
        if self._model is None:
            raise EstimateError("the nearest neighbours have no rows yet; call fit(Z, f) first")
        return self._model


def select_bandwidth(tree: cKDTree, rows: AveragedRows, neighbours: int) -> float:
    """Returns the bandwidth with the least squared error of points predicted from the others.

    Args:
        tree: The distinct points in standard deviations.
        rows: Their rates and counts, in the same order.
        neighbours: Number of neighbours averaged.
    """
    num_points = len(rows.rate)
    if num_points == 1:
        return 1.0
    rng = make_generator("training", "points for the choice of a bandwidth")
    tried = rng.permutation(num_points)[:_MAX_SELECTION_POINTS]
    distance, index = tree.query(tree.data[tried], k=min(neighbours, num_points - 1) + 1)
    distance, index = distance[:, 1:], index[:, 1:]  # the nearest is the point itself
    nearest, farthest = np.median(distance[:, 0]), np.median(distance[:, -1])
    smallest = 0.5 * nearest
    largest = max(smallest, farthest / _TRUNCATION)
    rate, count = rows.rate[index], rows.count[index]

    def error(bandwidth: float) -> float:
        weight = _weights(distance, bandwidth) * count
        predicted = np.sum(weight * rate, axis=1) / np.sum(weight, axis=1)
        return float(rows.count[tried] @ (rows.rate[tried] - predicted) ** 2)

    return float(min(np.geomspace(smallest, largest, _NUM_BANDWIDTHS), key=error))


def _weights(distance: Vector, bandwidth: float) -> Vector:
    """Returns weights relative to the nearest neighbour's, so that they never all underflow."""
    nearest = distance[..., :1]
    weights: Vector = np.exp(-0.5 * (distance**2 - nearest**2) / bandwidth**2)
    return weights
