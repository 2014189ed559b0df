"""A Gaussian process with constant mean and L1 kernel, given rows of success rates."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from lic_drake.estimate.averaging import AveragedRows
from lic_drake.estimate.kernels import l1_correlation, l1_correlation_with_gradient
from lic_drake.estimate.likelihood import Hyperparameters
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """The process given m rows; C is their covariance, noise included.

    Attributes:
        Z: Features, shape (m, d).
        rate: Success rates y, shape (m,).
        hyperparameters: Of the prior and the noise.
        lower: Cholesky factor of C, shape (m, m).
        prior_mean: Generalised-least-squares mean mu.
        alpha: C^-1 (y - mu), shape (m,).
        ones_weight: C^-1 1, shape (m,).
    """

    Z: Vector
    rate: Vector
    hyperparameters: Hyperparameters
    lower: Vector
    prior_mean: float
    alpha: Vector
    ones_weight: Vector

    def mean(self, Z: Vector) -> Vector:
        """Returns the posterior mean for queries Z, shape (n, d): shape (n,)."""
        mean: Vector = self.prior_mean + self.alpha @ self._covariance(Z)
        return mean

    def standard_deviation(self, Z: Vector) -> Vector:
        """Returns the posterior standard deviation of the surface, mu's uncertainty included."""
        covariance = self._covariance(Z)
        explained = solve_triangular(self.lower, covariance, lower=True, check_finite=False)
        mean_part = (1.0 - self.ones_weight @ covariance) ** 2 / self.ones_weight.sum()
        variance = self.hyperparameters.signal_variance - np.sum(explained**2, axis=0) + mean_part
        return np.sqrt(np.maximum(variance, 0.0))

    def mean_and_gradient(self, z: Vector) -> tuple[float, Vector]:
        """Returns the posterior mean at z, shape (d,), and its gradient, shape (d,)."""
        correlation, slope = l1_correlation_with_gradient(z, self.Z, self.hyperparameters.theta)
        weight = self.hyperparameters.signal_variance * self.alpha
        return float(self.prior_mean + weight @ correlation), weight @ slope

    def extended(self, rows: AveragedRows) -> "Posterior":
        """Returns the process given further rows, shape (k, d), too, in m^2 k steps.

        They stand beside the rows that are there, also beside equal ones. With the factor L of C
        the factor of the larger covariance [[C, B], [B^T, D]] is [[L, 0], [V^T, M]], where
        V = L^-1 B and M M^T = D - V^T V: the result is that of conditioning on all rows at once.
        """
        across = self._covariance(rows.Z)
        explained = solve_triangular(self.lower, across, lower=True, check_finite=False)
        own = _noisy_covariance(rows, self.hyperparameters) - explained.T @ explained
        corner, _ = cho_factor(own, lower=True, overwrite_a=True, check_finite=False)
        m = len(self.Z)
        lower = np.zeros((m + len(rows.Z), m + len(rows.Z)), order="F")
        lower[:m, :m], lower[m:, :m], lower[m:, m:] = self.lower, explained.T, corner
        return _from_factor(
            np.vstack([self.Z, rows.Z]),
            np.concatenate([self.rate, rows.rate]),
            self.hyperparameters,
            lower,
        )

    def _covariance(self, Z: Vector) -> Vector:
        """Returns the prior covariance of the rows with queries, shape (m, n)."""
        correlation = l1_correlation(self.Z, Z, self.hyperparameters.theta)
        return self.hyperparameters.signal_variance * correlation


def condition(rows: AveragedRows, hyperparameters: Hyperparameters) -> Posterior:
    """Returns the process given rows of success rates."""
    lower, _ = cho_factor(
        _noisy_covariance(rows, hyperparameters), lower=True, overwrite_a=True, check_finite=False
    )
    return _from_factor(rows.Z, rows.rate, hyperparameters, lower)


def _noisy_covariance(rows: AveragedRows, hyperparameters: Hyperparameters) -> Vector:
    """Returns the prior covariance of rows with each other, noise included, shape (m, m)."""
    correlation = l1_correlation(rows.Z, rows.Z, hyperparameters.theta)
    covariance: Vector = hyperparameters.signal_variance * correlation
    covariance[np.diag_indices(len(rows.Z))] += hyperparameters.noise(rows.count)
    return covariance


def _from_factor(
    Z: Vector, rate: Vector, hyperparameters: Hyperparameters, lower: Vector
) -> Posterior:
    """Returns the process given rows whose covariance has this Cholesky factor."""
    targets = np.column_stack([rate, np.ones(len(rate))])
    weights = cho_solve((lower, True), targets, check_finite=False)
    prior_mean = float(weights[:, 0].sum() / weights[:, 1].sum())
    return Posterior(
        Z=Z,
        rate=rate,
        hyperparameters=hyperparameters,
        lower=lower,
        prior_mean=prior_mean,
        alpha=weights[:, 0] - prior_mean * weights[:, 1],
        ones_weight=weights[:, 1],
    )
