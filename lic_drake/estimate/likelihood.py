"""Hyper-parameters of the Gaussian process by maximum marginal likelihood.

The model of the rows is y ~ N(mu 1, C), C = s R(theta) + diag(noise) + tau I, with the L1
correlation R, a constant mean mu (its generalised-least-squares value), and known noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri
from scipy.optimize import minimize

from lic_drake.estimate.checks import feature_scale
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

# Bounds of theta are per standard deviation of a feature: from nearly a straight line through
# all rows to rows that tell nothing about each other.
_BOUNDS = {"theta": (1e-3, 10.0), "signal": (1e-4, 4.0), "floor": (1e-6, 0.25)}
_THETA_STARTS = (0.05, 0.3, 1.5)
_MAX_SEARCH_ROWS = 300


@dataclass(frozen=True, kw_only=True)
class Hyperparameters:
    """The prior and the noise of a process.

    Attributes:
        theta: Decay of the correlation per unit of each feature, shape (d,).
        signal_variance: Prior variance s of the success probability around its mean.
        noise_floor: Variance tau of a row beyond binomial noise and smooth surface.
        reach_variance: Noise variance of a single reach; a row of n has the n-th part.
    """

    theta: Vector
    signal_variance: float
    noise_floor: float
    reach_variance: float

    def noise(self, count: Vector) -> Vector:
        """Returns the noise variance of rows with these numbers of reaches, shape (m,)."""
        return self.reach_variance / count + self.noise_floor


def coordinate_distances(Z: Vector) -> Vector:
    """Returns |z_i - z_j| of each feature, shape (d, n, n)."""
    distances: Vector = np.abs(Z.T[:, :, None] - Z.T[:, None, :])
    return distances


def negative_log_likelihood(
    log_parameters: Vector, distances: Vector, y: Vector, noise_variance: Vector
) -> tuple[float, Vector]:
    """Returns -log p(y) without its constant, and its gradient.

    Args:
        log_parameters: Logarithms of (theta, s, tau), shape (d + 2,).
        distances: See `coordinate_distances`, shape (d, n, n).
        y: Observed rates, shape (n,).
        noise_variance: Known variance of each rate, shape (n,).
    """
    parameters = np.exp(log_parameters)
    theta, signal, floor = parameters[:-2], parameters[-2], parameters[-1]
    n = len(y)
    signal_covariance = signal * np.exp(-np.tensordot(theta, distances, axes=1))
    covariance = signal_covariance.copy()
    covariance[np.diag_indices(n)] += noise_variance + floor
    lower, _ = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
    ones = np.ones(n)
    weights = cho_solve((lower, True), np.column_stack([y, ones]), check_finite=False)
    mu = (ones @ weights[:, 0]) / (ones @ weights[:, 1])
    alpha = weights[:, 0] - mu * weights[:, 1]
    value = 0.5 * (y - mu) @ alpha + np.sum(np.log(np.diagonal(lower)))

    # d value = 1/2 tr((C^-1 - alpha alpha^T) dC); mu adds nothing, as it is at its optimum.
    inverse, _ = dpotri(lower, lower=True)
    sensitivity = inverse - np.outer(alpha, alpha)
    diagonal = np.diagonal(sensitivity)
    below = np.tril(sensitivity, -1) * signal_covariance
    gradient = np.empty_like(parameters)
    gradient[:-2] = -theta * [np.vdot(below, distance) for distance in distances]
    gradient[-2] = below.sum() + 0.5 * signal * diagonal.sum()
    gradient[-1] = 0.5 * floor * diagonal.sum()
    return float(value), gradient


def fit_hyperparameters(
    Z: Vector, y: Vector, count: Vector, reach_variance: float
) -> Hyperparameters:
    """Maximises the marginal likelihood with L-BFGS-B from several starts, within bounds.

    The starts run on at most 300 of the rows; the best result is improved on all of them.

    Args:
        Z: Features, shape (n, d).
        y: Observed rates, shape (n,).
        count: Number of reaches in each row, shape (n,).
        reach_variance: Noise variance of a single reach.
    """
    scale = feature_scale(Z)
    Z = Z / scale
    noise = reach_variance / count
    num_features = Z.shape[1]
    bounds = np.log([_BOUNDS["theta"]] * num_features + [_BOUNDS["signal"], _BOUNDS["floor"]])
    variance = float(np.clip(np.var(y), *_BOUNDS["signal"]))
    starts = [
        np.log([theta] * num_features + [variance, 0.1 * variance]) for theta in _THETA_STARTS
    ]
    rng = make_generator("training", "rows for the search of hyper-parameters")
    few = rng.permutation(len(Z))[:_MAX_SEARCH_ROWS]

    def improve(start: Vector, rows: NDArray[np.intp]) -> tuple[float, Vector]:
        result = minimize(
            negative_log_likelihood,
            np.clip(start, *bounds.T),
            args=(coordinate_distances(Z[rows]), y[rows], noise[rows]),
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
        )
        return float(result.fun), np.asarray(result.x)

    found = [improve(start, few) for start in starts]
    _, best = min(found, key=lambda pair: pair[0])
    if len(few) < len(Z):
        _, best = improve(best, np.arange(len(Z)))
    theta, signal, floor = np.exp(best[:-2]) / scale, np.exp(best[-2]), np.exp(best[-1])
    return Hyperparameters(
        theta=theta,
        signal_variance=float(signal),
        noise_floor=float(floor),
        reach_variance=reach_variance,
    )
