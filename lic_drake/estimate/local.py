"""Local sub-sampling: estimators fitted to the nearest samples only (paper III-D, [15])."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from itertools import product
from typing import Any, Self, cast

import numpy as np
from sklearn.base import clone
from threadpoolctl import threadpool_limits

from lic_drake.errors import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.gaussian_process import GaussianProcess, Hyperparameters, condition
from lic_drake.estimate.nearest_neighbours import NearestNeighbours, select_bandwidths
from lic_drake.estimate.rows import average_rows, selection_folds
from lic_drake.seeds import make_generator
from lic_drake.types import BoolVector, IntVector, Vector

_CACHE_SIZE = 64
# Edge of a cell in length scales; all queries in a cell use the local model of its centre.
_CELL = 0.5
_SETTINGS_ROWS = 20_000
# Candidates for a process: decay over a length scale, and noise variance of a reach relative to
# the overall variance.
_DECAYS = (0.06, 0.12, 0.25, 0.5)
_NOISES = (0.03, 0.12, 0.5, 2.0, 8.0)
_NUM_TASKS = 20
_TASK_ROWS = 300
_TASK_QUERIES = 20


@dataclass(frozen=True)
class Neighbourhoods:
    """The n rows of a library in random order, with a distance between their situations.

    `X` to `weight` are as in `SuccessEstimator.fit`. Distance is Euclidean in `X[:, situation]`
    divided by `length_scale`, shape (d,): the neighbours' bandwidths that best predict held-out
    environments.
    """

    X: Vector
    y: Vector
    groups: IntVector
    weight: Vector
    situation: slice
    length_scale: Vector

    def in_scales(self, X: Vector) -> Vector:
        """Returns the situations of rows, shape (..., d), in length scales, shape (..., k)."""
        return X[..., self.situation] / self.length_scale[self.situation]

    def nearest(self, scaled: Vector, size: int, among: BoolVector | None = None) -> IntVector:
        """Returns the indices of the `size` rows nearest to a situation in length scales.

        Args:
            scaled: The situation, shape (k,).
            size: Maximum number of rows.
            among: Rows to choose from, shape (n,); all by default.
        """
        rows = np.arange(len(self.X)) if among is None else np.flatnonzero(among)
        distance = np.sum((self.in_scales(self.X[rows]) - scaled) ** 2, axis=1)
        if len(rows) <= size:
            return rows
        return rows[np.argpartition(distance, size)[:size]]


class LocalEstimator(SuccessEstimator):
    """Fits a model to the rows whose situation is nearest.

    Distance is measured in the situation, not in the decision: one local model then serves a whole
    optimisation over starts, and value and gradient belong to one smooth function. Where a moving
    base also moves the situation, a model covers half a length scale, and the estimate jumps
    slightly between models. Ties are broken at random, independently of the order of the library.

    Attributes:
        choose: Returns an unfitted model with settings for a library, such as `choose_process`.
        situation: The part of x by which rows are compared.
        size: Number of rows in a local model.
        length_scale: See `Neighbourhoods`. None: chosen by `fit` from 20,000 rows at most.
        model: The model with its settings. None: `fit` calls `choose`.
    """

    def __init__(
        self,
        choose: Callable[[Neighbourhoods], SuccessEstimator],
        situation: slice,
        size: int = 1000,
        length_scale: Vector | None = None,
        model: SuccessEstimator | None = None,
    ) -> None:
        self.choose = choose
        self.situation = situation
        self.size = size
        self.length_scale = length_scale
        self.model = model

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
        self._near = Neighbourhoods(X, y, known, weight, self.situation, scale)
        self.model_ = self.choose(self._near) if self.model is None else self.model
        self._cache: dict[bytes, SuccessEstimator] = {}

    def _settled(self) -> Self:
        chosen = {"length_scale": self._near.length_scale, "model": self.model_}
        return cast(Self, clone(self).set_params(**chosen))

    def _values(self, X: Vector) -> Vector:
        values = np.empty(len(X))
        cells, group = np.unique(self._cell(X), axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        members = np.split(order, np.cumsum(np.bincount(group.ravel()))[:-1])
        for cell, part in zip(cells, members, strict=True):
            values[part] = self._local_model(cell)._values(X[part])
        return values

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        # The choice of the local rows is not differentiated.
        return self._local_model(self._cell(x))._value_and_gradient(x)

    def _cell(self, X: Vector) -> Vector:
        """Returns the centres of the queries' cells, shape (..., k), in length scales."""
        return _CELL * np.round(self._near.in_scales(X) / _CELL) + 0.0

    def _local_model(self, cell: Vector) -> SuccessEstimator:
        near = self._near
        key = b"" if len(near.X) <= self.size else cell.tobytes()
        if key not in self._cache:
            if len(self._cache) >= _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            rows = near.nearest(cell, self.size)
            self._cache[key] = copy(self.model_)._learn(
                near.X[rows], near.y[rows], None, near.weight[rows]
            )
        return self._cache[key]


def choose_neighbours(near: Neighbourhoods) -> NearestNeighbours:
    """Returns 400 nearest neighbours with the length scales of the library as bandwidths."""
    return NearestNeighbours(neighbours=400, bandwidth=near.length_scale)


def choose_process(near: Neighbourhoods) -> GaussianProcess:
    """Returns a process with the settings that best predict held-out local rows.

    Features are scaled by the length scales. Decay of the correlation and noise of a reach minimise
    the squared error at 20 random situations whose environments are held out, each predicted from
    the 300 nearest rows of other environments. The marginal likelihood would take repeated outcomes
    in one environment as independent evidence: on D2 its scales differed a hundredfold between
    parts of the library.
    """
    variance = max(float(np.var(near.y)), 1e-4)
    candidates = [
        Hyperparameters(
            theta=decay / near.length_scale,
            signal_variance=variance,
            noise_floor=0.0,
            reach_variance=noise * variance,
        )
        for decay, noise in product(_DECAYS, _NOISES)
    ]
    error = np.zeros(len(candidates))
    with threadpool_limits(limits=1, user_api="blas"):
        for i in range(min(_NUM_TASKS, len(near.y))):
            here = near.groups == near.groups[i]
            if np.all(here):
                break
            centre = near.in_scales(near.X[i])
            seen = near.nearest(centre, _TASK_ROWS, ~here)
            asked = near.nearest(centre, _TASK_QUERIES, here)
            rows = average_rows(near.X[seen], near.y[seen], near.weight[seen])
            for k, candidate in enumerate(candidates):
                values = condition(rows, candidate).mean(near.X[asked])
                error[k] += np.sum((values - near.y[asked]) ** 2)
    return GaussianProcess(candidates[int(np.argmin(error))])
