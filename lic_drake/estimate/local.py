"""Local sub-sampling: an estimator fitted on the nearest samples only (paper III-D, [15])."""

from collections.abc import Iterator
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.checks import (
    EstimateError,
    Vector,
    checked_queries,
    checked_rows,
)
from lic_drake.estimate.estimator import Prediction, SuccessEstimator
from lic_drake.seeds import make_generator

_CACHE_SIZE = 64
# In length scales: queries in one cell share a local model, which is that of the cell's centre.
_CELL = 0.5


class LocalModel(SuccessEstimator, Protocol):
    """An estimator that can be given other rows without choosing its settings anew."""

    @property
    def length_scale(self) -> Vector:
        """How far rows speak for each other along each feature, shape (d,)."""
        ...

    def conditioned_on(self, Z: ArrayLike, f: ArrayLike) -> "LocalModel":
        """Returns an estimator with these settings that has seen the given rows only."""
        ...


class LocalEstimator:
    """Fits a model on the rows whose situation is nearest; satisfies `SuccessEstimator`.

    The model chooses its settings once, on a random part of the rows, and with them the length
    scales by which rows are near. They are near in the situation, not in the decision: one local
    model then serves a whole optimisation over starts, and value and gradient belong to one smooth
    function. Where a moving base moves the situation, too, a model serves half a length scale and
    the estimate has a small jump where the next one takes over. Rows at equal distance are taken
    in random order, lest the order of the library choose environments. The spread is the model's.

    Attributes:
        size: Number of rows in a local model.
    """

    def __init__(
        self,
        model: LocalModel,
        situation: slice,
        *,
        size: int = 1000,
        settings_size: int = 1000,
    ) -> None:
        """Sets up an estimator.

        Args:
            model: Unfitted; `fit` makes it choose its settings.
            situation: The part of z that says how near a row is.
            size: See the class.
            settings_size: Number of rows from which the model chooses its settings.

        Raises:
            EstimateError: Size below 2.
        """
        if size < 2:
            raise EstimateError(f"a local model needs 2 or more rows, got size {size}")
        self.size = size
        self._settings_size = settings_size
        self._model = model
        self._situation = situation
        self._Z: Vector | None = None
        self._f = np.zeros(0)
        self._scaled = np.zeros((0, 0))
        self._cache: dict[bytes, SuccessEstimator] = {}

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Keeps features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        order = make_generator("training", "order of local rows").permutation(len(Z))
        part = order[: max(self._settings_size, self.size)]
        self._model.fit(
            Z[part], f[part], None if environment is None else np.asarray(environment)[part]
        )
        self._Z, self._f = Z[order], f[order]
        self._scaled = self._Z[:, self._situation] / self._model.length_scale[self._situation]
        self._cache.clear()
        return self

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        Z = checked_queries(Z, self._fitted().shape[1])
        probability, spread = np.empty(len(Z)), np.empty(len(Z))
        for cell, members in self._cells_of(Z):
            prediction = self._local_model(cell).predict(Z[members])
            probability[members], spread[members] = prediction.probability, prediction.spread
        return Prediction(probability=probability, spread=spread)

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the local models' estimates for queries Z, shape (n, d): shape (n,)."""
        Z = checked_queries(Z, self._fitted().shape[1])
        values = np.empty(len(Z))
        for cell, members in self._cells_of(Z):
            values[members] = self._local_model(cell).values(Z[members])
        return values

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the local model's value and gradient at z, shape (d,).

        The model belongs to z's situation: the gradient by the situation leaves out that other
        situations have other rows.
        """
        query = checked_queries(np.atleast_2d(z), self._fitted().shape[1])[0]
        return self._local_model(self._cell(query)).value_and_gradient(query)

    def _cell(self, Z: Vector) -> Vector:
        """Returns the centres of the queries' cells, shape (..., k), in length scales."""
        in_scales = Z[..., self._situation] / self._model.length_scale[self._situation]
        centres: Vector = _CELL * np.round(in_scales / _CELL) + 0.0
        return centres

    def _cells_of(self, Z: Vector) -> Iterator[tuple[Vector, NDArray[np.intp]]]:
        """Yields each cell that holds any queries, with their indices."""
        cells, group = np.unique(self._cell(Z), axis=0, return_inverse=True)
        order = np.argsort(group.ravel(), kind="stable")
        members = np.split(order, np.cumsum(np.bincount(group.ravel()))[:-1])
        yield from zip(cells, members, strict=True)

    def _local_model(self, cell: Vector) -> SuccessEstimator:
        rows = self._fitted()
        if len(rows) <= self.size:
            return self._model
        key = cell.tobytes()
        if key not in self._cache:
            distance = np.sum((self._scaled - cell) ** 2, axis=1)
            nearest = np.argpartition(distance, self.size)[: self.size]
            if len(self._cache) >= _CACHE_SIZE:
                del self._cache[next(iter(self._cache))]
            self._cache[key] = self._model.conditioned_on(rows[nearest], self._f[nearest])
        return self._cache[key]

    def _fitted(self) -> Vector:
        if self._Z is None:
            raise EstimateError("the local estimator has no rows yet; call fit(Z, f) first")
        return self._Z
