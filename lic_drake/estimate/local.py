"""Local sub-sampling: an estimator fitted on the nearest samples only (paper III-D, [15])."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.averaging import average_rows
from lic_drake.estimate.bandwidth import select_bandwidths
from lic_drake.estimate.checks import EstimateError, checked_queries, checked_rows, checked_weights
from lic_drake.estimate.estimator import Prediction, SuccessEstimator
from lic_drake.estimate.folds import selection_folds
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

_CACHE_SIZE = 64
# In length scales: queries in one cell share a local model, which is that of the cell's centre.
_CELL = 0.5
_SETTINGS_ROWS = 20_000


@dataclass(frozen=True, kw_only=True)
class Neighbourhoods:
    """The rows of a library in random order, and how near to each other their situations are.

    Attributes:
        Z: Features, shape (n, d).
        f: Successes, shape (n,).
        environment: Environment of each row, shape (n,); -1 for rows that were added later.
        weight: How many reaches each row counts as, shape (n,).
        situation: The part of z that says how near a row is.
        length_scale: How far rows speak for each other along each feature, shape (d,): the
            bandwidths of neighbours that best predict environments that were held out.
    """

    Z: Vector
    f: Vector
    environment: NDArray[np.int64]
    weight: Vector
    situation: slice
    length_scale: Vector

    def in_scales(self, Z: Vector) -> Vector:
        """Returns the situations of rows, shape (..., d), in length scales, shape (..., k)."""
        scaled: Vector = Z[..., self.situation] / self.length_scale[self.situation]
        return scaled

    def nearest(
        self, scaled: Vector, size: int, among: NDArray[np.bool_] | None = None
    ) -> NDArray[np.intp]:
        """Returns the indices of the rows nearest to a situation, shape (size,) or fewer.

        Args:
            scaled: The situation in length scales, shape (k,).
            size: Number of rows.
            among: Which rows to choose from, shape (n,), by default all.
        """
        rows = np.arange(len(self.Z)) if among is None else np.flatnonzero(among)
        distance = np.sum((self.in_scales(self.Z[rows]) - scaled) ** 2, axis=1)
        if len(rows) <= size:
            return rows
        found: NDArray[np.intp] = rows[np.argpartition(distance, size)[:size]]
        return found


class LocalModel(Protocol):
    """The settings of an estimator, which it keeps whatever rows it is given."""

    def conditioned_on(
        self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0
    ) -> SuccessEstimator:
        """Returns an estimator with these settings that has seen the given rows only."""
        ...


class LocalEstimator:
    """Fits a model on the rows whose situation is nearest; satisfies `SuccessEstimator`.

    Rows are near in the situation, not in the decision: one local model then serves a whole
    optimisation over starts, and value and gradient belong to one smooth function. Where a moving
    base moves the situation, too, a model serves half a length scale, and the estimate has a small
    jump where the next one takes over. Rows at equal distance are taken in random order, lest the
    order of the library choose environments. The spread is the model's.

    Attributes:
        size: Number of rows in a local model.
    """

    def __init__(
        self,
        choose_model: Callable[[Neighbourhoods], LocalModel],
        situation: slice,
        *,
        size: int = 1000,
    ) -> None:
        """Sets up an estimator.

        Args:
            choose_model: Returns the model with settings for a library; called once a fit.
            situation: The part of z that says how near a row is.
            size: See the class.

        Raises:
            EstimateError: Size below 2.
        """
        if size < 2:
            raise EstimateError(f"a local model needs 2 or more rows, got size {size}")
        self.size = size
        self._choose_model = choose_model
        self._situation = situation
        self._near: Neighbourhoods | None = None
        self._model: LocalModel | None = None
        self._cache: dict[bytes, SuccessEstimator] = {}

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Keeps features Z, shape (n, d), and successes f, shape (n,); see `Predictor`.

        Length scales come from 20,000 rows at most.
        """
        Z, f = checked_rows(Z, f)
        selection_folds(environment, len(f))  # Refuses environments of another length.
        order = make_generator("training", "order of local rows").permutation(len(Z))
        Z, f = Z[order], f[order]
        known = np.arange(len(f)) if environment is None else np.asarray(environment)[order]
        part = slice(0, _SETTINGS_ROWS)
        fold = selection_folds(known[part], len(f[part]))
        self._near = Neighbourhoods(
            Z=Z,
            f=f,
            environment=known,
            weight=np.ones(len(f)),
            situation=self._situation,
            length_scale=select_bandwidths(average_rows(Z[part], f[part]), f[part], fold),
        )
        self._model = self._choose_model(self._near)
        self._cache.clear()
        return self

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows in; see `UpdatableEstimator`. Length scales and settings stay."""
        near = self._fitted()
        Z, f = checked_rows(Z, f)
        checked_queries(Z, near.Z.shape[1])
        count = len(near.f) + len(f)
        order = make_generator("training", "order of local rows").permutation(count)
        self._near = replace(
            near,
            Z=np.vstack([near.Z, Z])[order],
            f=np.concatenate([near.f, f])[order],
            environment=np.concatenate([near.environment, np.full(len(f), -1)])[order],
            weight=np.concatenate([near.weight, checked_weights(weight, len(f))])[order],
        )
        self._cache.clear()
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        Z = checked_queries(Z, self._fitted().Z.shape[1])
        probability, spread = np.empty(len(Z)), np.empty(len(Z))
        for cell, members in self._cells_of(Z):
            prediction = self._local_model(cell).predict(Z[members])
            probability[members], spread[members] = prediction.probability, prediction.spread
        return Prediction(probability=probability, spread=spread)

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the local models' estimates for queries Z, shape (n, d): shape (n,)."""
        Z = checked_queries(Z, self._fitted().Z.shape[1])
        values = np.empty(len(Z))
        for cell, members in self._cells_of(Z):
            values[members] = self._local_model(cell).values(Z[members])
        return values

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the local model's value and gradient at z, shape (d,).

        The model belongs to z's situation: the gradient by the situation leaves out that other
        situations have other rows.
        """
        query = checked_queries(np.atleast_2d(z), self._fitted().Z.shape[1])[0]
        return self._local_model(self._cell(query)).value_and_gradient(query)

    def _cell(self, Z: Vector) -> Vector:
        """Returns the centres of the queries' cells, shape (..., k), in length scales."""
        centres: Vector = _CELL * np.round(self._fitted().in_scales(Z) / _CELL) + 0.0
        return centres

    def _cells_of(self, Z: Vector) -> Iterator[tuple[Vector, NDArray[np.intp]]]:
        """Yields each cell that holds any queries, with their indices."""
        cells, group = np.unique(self._cell(Z), axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        members = np.split(order, np.cumsum(np.bincount(group.ravel()))[:-1])
        yield from zip(cells, members, strict=True)

    def _local_model(self, cell: Vector) -> SuccessEstimator:
        near, model = self._fitted(), self._model
        assert model is not None
        key = b"" if len(near.Z) <= self.size else cell.tobytes()
        if key not in self._cache:
            if len(self._cache) >= _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            rows = near.nearest(cell, self.size)
            self._cache[key] = model.conditioned_on(near.Z[rows], near.f[rows], near.weight[rows])
        return self._cache[key]

    def _fitted(self) -> Neighbourhoods:
        if self._near is None:
            raise EstimateError("the local estimator has no rows yet; call fit(Z, f) first")
        return self._near
