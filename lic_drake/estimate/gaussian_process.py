"""Gaussian-process regression of the success probability (paper III-D)."""

from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from lic_drake.estimate.averaging import AveragedRows, average_rows, reach_variance
from lic_drake.estimate.checks import EstimateError, checked_queries, checked_rows, checked_weights
from lic_drake.estimate.estimator import Prediction
from lic_drake.estimate.folds import selection_folds
from lic_drake.estimate.likelihood import Hyperparameters, fit_hyperparameters
from lic_drake.estimate.posterior import Posterior, condition
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

_DESIGN_EFFECTS = (1.0, 2.0, 4.0, 8.0, 16.0)
# A matrix of that many rows takes half a gigabyte. The search for settings inverts hundreds.
_MAX_ROWS = 8000
_MAX_SETTINGS_ROWS = 1000


class GaussianProcess:
    """An exact GP with constant mean, L1 kernel and binomial noise; satisfies `SuccessEstimator`.

    Scales, signal variance and noise floor maximise the marginal likelihood, which takes the
    noise of all reaches as independent. Reaches in one environment are not: a cylinder in the way
    spoils many of them, and the likelihood reads such luck as surface. So the noise is then
    multiplied by the factor (the design effect of cluster samples) that best predicts environments
    that were held out.

    The spread is the posterior standard deviation of the surface, the uncertainty of the mean
    included, the noise floor not.

    Attributes:
        average: Whether rows of the same features are averaged first. The paper's software
            refused duplicate inputs, so a library of several environments had to be averaged,
            or jittered.
    """

    def __init__(
        self, *, average: bool = True, hyperparameters: Hyperparameters | None = None
    ) -> None:
        """Sets up an estimator.

        Args:
            average: See the class.
            hyperparameters: Taken as they are; by default `fit` chooses them.
        """
        self.average = average
        self._given = hyperparameters
        self._posterior: Posterior | None = None

    @property
    def hyperparameters(self) -> Hyperparameters:
        """The hyper-parameters in use.

        Raises:
            EstimateError: Neither given nor fitted yet.
        """
        return self._fitted().hyperparameters if self._given is None else self._given

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); see `Predictor`."""
        Z, f = checked_rows(Z, f)
        hyperparameters = self._given
        # The matrices are small: OpenBLAS threads that wait for a busy core made a fit of two
        # seconds take minutes.
        with threadpool_limits(limits=1, user_api="blas"):
            if hyperparameters is None:
                fold = selection_folds(environment, len(f))
                hyperparameters = self._choose_hyperparameters(Z, f, fold)
            rows = self._rows(Z, f)
            _refuse_too_many(len(rows.Z))
            self._posterior = condition(rows, hyperparameters)
        return self

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows in; see `UpdatableEstimator`.

        A row of weight w has the w-th part of a reach's noise variance. Hyper-parameters stay, and
        the posterior is that of all rows at once. Rows of the same features are averaged among
        those of one update, not with earlier ones: the noise floor counts once for each.
        """
        posterior = self._fitted()
        Z, f = checked_rows(Z, f)
        checked_queries(Z, posterior.Z.shape[1])
        rows = self._rows(Z, f, checked_weights(weight, len(f)))
        _refuse_too_many(len(posterior.Z) + len(rows.Z))
        with threadpool_limits(limits=1, user_api="blas"):
            self._posterior = posterior.extended(rows)
        return self

    def conditioned_on(
        self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0
    ) -> "GaussianProcess":
        """Returns a process with these hyper-parameters that has seen other rows only."""
        other = GaussianProcess(average=self.average, hyperparameters=self.hyperparameters)
        Z, f = checked_rows(Z, f)
        rows = other._rows(Z, f, checked_weights(weight, len(f)))
        _refuse_too_many(len(rows.Z))
        with threadpool_limits(limits=1, user_api="blas"):
            other._posterior = condition(rows, self.hyperparameters)
        return other

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `Predictor`."""
        posterior = self._fitted()
        Z = checked_queries(Z, posterior.Z.shape[1])
        return Prediction(
            probability=np.clip(posterior.mean(Z), 0.0, 1.0),
            spread=posterior.standard_deviation(Z),
        )

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the posterior means at queries Z, shape (n, d): shape (n,)."""
        posterior = self._fitted()
        return posterior.mean(checked_queries(Z, posterior.Z.shape[1]))

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the posterior mean at z, shape (d,), and its gradient.

        At a kink the gradient is the mean of both sides'.
        """
        posterior = self._fitted()
        return posterior.mean_and_gradient(
            checked_queries(np.atleast_2d(z), posterior.Z.shape[1])[0]
        )

    def _rows(self, Z: Vector, f: Vector, weight: Vector | None = None) -> AveragedRows:
        if self.average:
            return average_rows(Z, f, weight)
        count = np.ones(len(f)) if weight is None else weight
        return AveragedRows(Z=Z, rate=f, count=count, member=np.arange(len(f)))

    def _choose_hyperparameters(
        self, Z: Vector, f: Vector, fold: NDArray[np.intp]
    ) -> Hyperparameters:
        if len(self._rows(Z, f).Z) > _MAX_SETTINGS_ROWS:
            order = make_generator("training", "rows for settings").permutation(len(f))
            part = order[:_MAX_SETTINGS_ROWS]
            Z, f, fold = Z[part], f[part], fold[part]
        rows = self._rows(Z, f)
        likeliest = fit_hyperparameters(
            rows.Z, rows.rate, rows.count, reach_variance(average_rows(Z, f))
        )
        num_folds = int(fold.max()) + 1
        if num_folds == 1:
            return likeliest
        candidates = [
            replace(likeliest, reach_variance=effect * likeliest.reach_variance)
            for effect in _DESIGN_EFFECTS
        ]
        error = np.zeros(len(candidates))
        for held_out in range(num_folds):
            out = fold == held_out
            seen, unseen = self._rows(Z[~out], f[~out]), average_rows(Z[out], f[out])
            for i, candidate in enumerate(candidates):
                predicted = condition(seen, candidate).mean(unseen.Z)
                error[i] += unseen.count @ (unseen.rate - predicted) ** 2
        return candidates[int(np.argmin(error))]

    def _fitted(self) -> Posterior:
        if self._posterior is None:
            raise EstimateError("the Gaussian process has no rows yet; call fit(Z, f) first")
        return self._posterior


def _refuse_too_many(rows: int) -> None:
    if rows > _MAX_ROWS:
        raise EstimateError(
            f"an exact Gaussian process takes at most {_MAX_ROWS} distinct rows, got {rows};"
            " use the estimator 'gp-raw' or 'knn'"
        )
