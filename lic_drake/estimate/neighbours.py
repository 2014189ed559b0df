"""K nearest neighbours, and estimators fitted to the nearest rows only (paper III-D, [15])."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree
from threadpoolctl import threadpool_limits

from lic_drake.errors import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters, Posterior
from lic_drake.estimate.rows import AveragedRows, average_rows, feature_scale, selection_folds
from lic_drake.seeds import make_generator
from lic_drake.types import BoolVector, IntVector, Vector

# The search for bandwidths, in standard deviations of a feature, from nearest neighbour only to
# uninformative.
_MAX_POINTS = 500
_SEARCH_NEIGHBOURS = 100
_SMALLEST, _LARGEST = 0.02, 8.0
_COMMON = np.geomspace(0.1, 1.6, 9)
_STEPS = (2.0, 2.0, np.sqrt(2.0))
_DECIMALS = 9

# Local models: edge of a cell, whose queries all use the model of its centre, in length scales.
_CELL = 0.5
_CACHE_SIZE = 64
_SETTINGS_ROWS = 20_000
# Candidates for a process: decay over a length scale, and noise variance of a reach relative to
# the overall variance.
_DECAYS = (0.06, 0.12, 0.25, 0.5)
_NOISES = (0.03, 0.12, 0.5, 2.0, 8.0)
_NUM_TASKS = 20
_TASK_ROWS = 300
_TASK_QUERIES = 20


@dataclass(eq=False, repr=False)
class NearestNeighbours(SuccessEstimator):
    """A Gaussian-weighted average over neighbours.

    Neighbours are distinct feature vectors, each with the mean and number of its reaches. Distances
    d are Euclidean in features divided by their bandwidths, weights exp(-d^2 / 2). Where
    neighbours are sparse the estimate is overconfident.

    Attributes:
        neighbours: K, the number of distinct feature vectors averaged.
        bandwidth: Standard deviation of the weights along each feature, shape (d,), in its unit.
            None: those that best predict held-out environments. `bandwidth_` are those in use.
        held_out: Matrix A, shape (k, d), or None. Rows with equal A x are held out together instead
            of environments, where copies of a row in other ones would favour tiny bandwidths.
    """

    neighbours: int = 100
    bandwidth: ArrayLike | None = None
    held_out: ArrayLike | None = None
    _chosen = ("bandwidth",)

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

    def _values(self, X: Vector) -> Vector:
        weight, index = _neighbours(self._tree, X / self.bandwidth_, self.neighbours)
        weight *= self._count[index]
        values = np.sum(weight * self._rate[index], axis=1) / weight.sum(axis=1)
        return np.clip(values, 0.0, 1.0)  # Outside [0, 1] by rounding only.

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        # For a fixed set of neighbours; the estimate jumps where the set changes.
        query = x / self.bandwidth_
        weight, index = _neighbours(self._tree, query, self.neighbours)
        weight *= self._count[index]
        weight /= weight.sum()
        rate = self._rate[index]
        value = weight @ rate
        pull = (weight * (rate - value)) @ (self._points[index] - query)
        return float(value), pull / self.bandwidth_


def _neighbours(tree: cKDTree, queries: Vector, neighbours: int) -> tuple[Vector, IntVector]:
    """Returns weights and indices of up to `neighbours` points, shape (..., k), nearest first."""
    distance, index = tree.query(queries, k=range(1, min(neighbours, tree.n) + 1))
    return np.exp(-0.5 * (distance**2 - distance[..., :1] ** 2)), index  # Without underflow.


def select_bandwidths(rows: AveragedRows, y: Vector, weight: Vector, fold: IntVector) -> Vector:
    """Returns the bandwidth of each feature, shape (d,), with the least held-out squared error.

    The search is coordinate-wise, with shrinking steps. The error is that at 500 points at most
    and with 100 neighbours. `y`, `weight` and `fold` are those of each reach, shape (n,).
    """
    scale = feature_scale(rows.X)
    if len(rows.X) == 1 or fold.max() == 0:
        return scale  # Nothing can be held out.
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
        near, index = _neighbours(cKDTree(points), points[tried], _SEARCH_NEIGHBOURS)
        ends = np.arange(0, index.size + 1, index.shape[1])
        kernel = csr_array((near.ravel(), index.ravel(), ends), shape=(len(tried), len(points)))
        total = kernel @ seen_tries
        # Where all neighbours are held out, predict the overall rate.
        known = total > 0.0
        predicted = np.where(known, kernel @ seen_successes / np.where(known, total, 1.0), rate)
        return float(np.sum(hits * (1.0 - predicted) ** 2 + misses * predicted**2))

    bandwidth = scale * float(min(_COMMON, key=lambda factor: error(factor * scale)))
    least = error(bandwidth)
    varying = np.flatnonzero(np.ptp(rows.X, axis=0) > 0.0)
    for step, feature in product(_STEPS, varying):
        for factor in (step, 1.0 / step):
            while True:
                other = bandwidth.copy()
                other[feature] *= factor
                inside = _SMALLEST < other[feature] / scale[feature] < _LARGEST
                if not inside or (found := error(other)) >= least:
                    break
                bandwidth, least = other, found
    return bandwidth


@dataclass(eq=False, repr=False)
class LocalEstimator(SuccessEstimator):
    """Fits a model to the rows whose situation is nearest.

    Distance is measured in the situation, not in the decision: one local model then serves a whole
    optimisation over starts, and value and gradient belong to one smooth function. Where a moving
    base also moves the situation, a model covers half a length scale, and the estimate jumps
    slightly between models. Ties are broken at random.

    Attributes:
        choose: Returns an unfitted model with settings, from this estimator with its
            `length_scale_` and rows; such as `choose_process`.
        situation: The part of x by which rows are compared.
        size: Number of rows in a local model.
        length_scale: Divisor of each feature in distances, shape (d,). None: the bandwidths that
            best predict held-out environments among at most 20,000 rows.
        model: The model with its settings. None: `fit` calls `choose`.
    """

    choose: Callable[["LocalEstimator"], SuccessEstimator]
    situation: slice
    size: int = 1000
    length_scale: Vector | None = None
    model: SuccessEstimator | None = None
    _chosen = ("length_scale", "model")

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        if self.size < 2:
            raise EstimateError(f"a local model needs 2 or more rows, got size {self.size}")
        order = make_generator("training", "order of local rows").permutation(len(X))
        X, y, weight = X[order], y[order], weight[order]
        known = np.arange(len(y)) if groups is None else groups[order]
        scale = self.length_scale
        if scale is None:
            part = slice(0, _SETTINGS_ROWS)
            fold = selection_folds(known[part], len(y[part]))
            rows = average_rows(X[part], y[part], weight[part])
            scale = select_bandwidths(rows, y[part], weight[part], fold)
        self._X, self._y, self._groups, self._weight = X, y, known, weight
        self.length_scale_ = scale
        self.model_ = self.choose(self) if self.model is None else self.model
        self._cache: dict[bytes, SuccessEstimator] = {}

    def _values(self, X: Vector) -> Vector:
        values = np.empty(len(X))
        cells, group = np.unique(self._cell(X), axis=0, return_inverse=True)
        for k, cell in enumerate(cells):
            part = group.ravel() == k
            values[part] = self._local_model(cell)._values(X[part])
        return values

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        # The choice of the local rows is not differentiated.
        return self._local_model(self._cell(x))._value_and_gradient(x)

    def _in_scales(self, X: Vector) -> Vector:
        """Returns the situations of rows, shape (..., d), in length scales, shape (..., k)."""
        return X[..., self.situation] / self.length_scale_[self.situation]

    def _cell(self, X: Vector) -> Vector:
        """Returns the centres of the queries' cells, shape (..., k), in length scales."""
        return _CELL * np.round(self._in_scales(X) / _CELL) + 0.0

    def _nearest(self, scaled: Vector, size: int, among: BoolVector | None = None) -> IntVector:
        """Returns the `size` rows, of those `among`, nearest to a situation in length scales."""
        rows = np.arange(len(self._X)) if among is None else np.flatnonzero(among)
        distance = np.sum((self._in_scales(self._X[rows]) - scaled) ** 2, axis=1)
        if len(rows) <= size:
            return rows
        return rows[np.argpartition(distance, size)[:size]]

    def _local_model(self, cell: Vector) -> SuccessEstimator:
        key = b"" if len(self._X) <= self.size else cell.tobytes()
        if key not in self._cache:
            if len(self._cache) >= _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            rows = self._nearest(cell, self.size)
            self._cache[key] = copy(self.model_)._learn(
                self._X[rows], self._y[rows], None, self._weight[rows]
            )
        return self._cache[key]


def choose_neighbours(local: LocalEstimator) -> NearestNeighbours:
    """Returns 400 nearest neighbours with the length scales of the library as bandwidths."""
    return NearestNeighbours(neighbours=400, bandwidth=local.length_scale_)


def choose_process(local: LocalEstimator) -> GaussianProcess:
    """Returns a process with the settings that best predict held-out local rows.

    Features are scaled by the length scales. Decay of the correlation and noise of a reach minimise
    the squared error at 20 random situations whose environments are held out, each predicted from
    the 300 nearest rows of other environments. The marginal likelihood would take repeated outcomes
    in one environment as independent evidence.
    """
    X, y, groups, weight = local._X, local._y, local._groups, local._weight
    variance = max(float(np.var(y)), 1e-4)
    candidates = [
        Hyperparameters(
            theta=decay / local.length_scale_,
            signal_variance=variance,
            noise_floor=0.0,
            reach_variance=noise * variance,
        )
        for decay, noise in product(_DECAYS, _NOISES)
    ]
    error = np.zeros(len(candidates))
    with threadpool_limits(limits=1, user_api="blas"):
        for i in range(min(_NUM_TASKS, len(y))):
            here = groups == groups[i]
            if np.all(here):
                break
            centre = local._in_scales(X[i])
            seen = local._nearest(centre, _TASK_ROWS, ~here)
            asked = local._nearest(centre, _TASK_QUERIES, here)
            rows = average_rows(X[seen], y[seen], weight[seen])
            for k, candidate in enumerate(candidates):
                values = Posterior(rows, candidate).mean(X[asked])
                error[k] += np.sum((values - y[asked]) ** 2)
    return GaussianProcess(candidates[int(np.argmin(error))])
