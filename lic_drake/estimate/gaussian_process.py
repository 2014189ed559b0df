"""Gaussian-process regression of the success probability (paper III-D)."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from lic_drake.estimate.averaging import average_rows, binomial_variance
from lic_drake.estimate.checks import EstimateError, Vector, checked_queries, checked_rows
from lic_drake.estimate.estimator import Prediction
from lic_drake.estimate.kernels import l1_correlation, l1_correlation_with_gradient
from lic_drake.estimate.likelihood import Hyperparameters, fit_hyperparameters


@dataclass(frozen=True, kw_only=True)
class _Posterior:
    """The process given m rows; C is their covariance.

    Attributes:
        Z: Features, shape (m, d).
        hyperparameters: Of the prior.
        lower: Cholesky factor of C, shape (m, m).
        mean: Generalised-least-squares mean mu.
        alpha: C^-1 (y - mu), shape (m,).
        ones_weight: C^-1 1, shape (m,).
    """

    Z: Vector
    hyperparameters: Hyperparameters
    lower: Vector
    mean: float
    alpha: Vector
    ones_weight: Vector


class GaussianProcess:
    """An exact GP with constant mean, L1 kernel and binomial noise; satisfies `SuccessEstimator`.

    The spread is the posterior standard deviation of the smooth surface, the mean's uncertainty
    included, the noise floor not. It takes the noise of different (goal, start) pairs as
    independent, though pairs tried in the same environments share luck: with few environments
    it is too small.

    Attributes:
        average: Whether rows of the same features are averaged first. The paper's software
            refused duplicate inputs, so its library of 20 environments had to be averaged,
            or jittered.
    """

    def __init__(
        self, *, average: bool = True, hyperparameters: Hyperparameters | None = None
    ) -> None:
        """Sets up an estimator.

        Args:
            average: See the class.
            hyperparameters: Taken as they are; by default `fit` maximises the likelihood.
        """
        self.average = average
        self._given = hyperparameters
        self._posterior: _Posterior | None = None

    @property
    def hyperparameters(self) -> Hyperparameters:
        """The hyper-parameters in use.

        Raises:
            EstimateError: Not fitted yet.
        """
        return self._fitted().hyperparameters

    def fit(self, Z: ArrayLike, f: ArrayLike) -> Self:
        """Learns from features Z, shape (n, d), and successes f, shape (n,); returns itself."""
        Z, f = checked_rows(Z, f)
        y, count = f, np.ones(len(f))
        if self.average:
            rows = average_rows(Z, f)
            Z, y, count = rows.Z, rows.rate, rows.count
        noise = binomial_variance(y, count)
        chosen = self._given or fit_hyperparameters(Z, y, noise)
        covariance = chosen.signal_variance * l1_correlation(Z, Z, chosen.theta)
        covariance[np.diag_indices(len(Z))] += noise + chosen.noise_floor
        lower, _ = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
        weights = cho_solve((lower, True), np.column_stack([y, np.ones(len(y))]))
        mean = float(weights[:, 0].sum() / weights[:, 1].sum())
        self._posterior = _Posterior(
            Z=Z,
            hyperparameters=chosen,
            lower=lower,
            mean=mean,
            alpha=weights[:, 0] - mean * weights[:, 1],
            ones_weight=weights[:, 1],
        )
        return self

    def conditioned_on(self, Z: ArrayLike, f: ArrayLike) -> "GaussianProcess":
        """Returns a process with these hyper-parameters that has seen other rows only."""
        return GaussianProcess(average=self.average, hyperparameters=self.hyperparameters).fit(
            Z, f
        )

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d); see `SuccessEstimator`."""
        post = self._fitted()
        Z = checked_queries(Z, post.Z.shape[1])
        signal = post.hyperparameters.signal_variance
        covariance = signal * l1_correlation(post.Z, Z, post.hyperparameters.theta)
        probability = post.mean + post.alpha @ covariance
        explained = solve_triangular(post.lower, covariance, lower=True, check_finite=False)
        mean_part = (1.0 - post.ones_weight @ covariance) ** 2 / post.ones_weight.sum()
        variance = signal - np.sum(explained**2, axis=0) + mean_part
        return Prediction(
            probability=np.clip(probability, 0.0, 1.0),
            spread=np.sqrt(np.maximum(variance, 0.0)),
        )

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the posterior mean at z, shape (d,), and its gradient.

        At a kink the gradient is the mean of both sides'.
        """
        post = self._fitted()
        z = checked_queries(np.atleast_2d(z), post.Z.shape[1])[0]
        correlation, slope = l1_correlation_with_gradient(z, post.Z, post.hyperparameters.theta)
        weight = post.hyperparameters.signal_variance * post.alpha
        return float(post.mean + weight @ correlation), weight @ slope

    def _fitted(self) -> _Posterior:
        if self._posterior is None:
            raise EstimateError("the Gaussian process has no rows yet; call fit(Z, f) first")
        return self._posterior
