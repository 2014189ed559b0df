"""Gaussian-process regression of the success probability (paper III-D).

The kernel is the absolute exponential exp(-sum_i theta_i |d_i|), with a kink wherever a feature
equals that of a training row. Rows are modelled as y ~ N(mu 1, C) with C = s R(theta) +
diag(noise) + tau I, the correlation R, the generalised-least-squares mean mu, and known noise.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.linalg.lapack import dpotri
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from threadpoolctl import threadpool_limits

from lic_drake.errors import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.rows import (
    AveragedRows,
    average_rows,
    feature_scale,
    reach_variance,
    selection_folds,
)
from lic_drake.seeds import make_generator
from lic_drake.types import IntVector, Vector

_DESIGN_EFFECTS = (1.0, 2.0, 4.0, 8.0, 16.0)
# A covariance of this size takes 0.5 GB; the search for settings inverts hundreds of matrices.
_MAX_ROWS = 8000
_MAX_SETTINGS_ROWS = 1000
_MAX_SEARCH_ROWS = 300
# Bounds of theta are per standard deviation of a feature: nearly linear to uncorrelated rows.
_BOUNDS = {"theta": (1e-3, 10.0), "signal": (1e-4, 4.0), "floor": (1e-6, 0.25)}
_THETA_STARTS = (0.05, 0.3, 1.5)


@dataclass(frozen=True, kw_only=True)
class Hyperparameters:
    """Prior and noise: theta, shape (d,), is the decay per unit of each feature.

    A row of n reaches has the noise variance reach_variance / n + noise_floor (tau).
    """

    theta: Vector
    signal_variance: float
    noise_floor: float
    reach_variance: float


@dataclass(eq=False, repr=False)
class GaussianProcess(SuccessEstimator):
    """An exact GP with constant mean, L1 kernel and binomial noise, on averaged rows.

    Scales, signal variance and noise floor maximise the marginal likelihood, which assumes
    independent noise and would overfit the correlated outcomes in one environment. The noise is
    therefore multiplied by the factor (the design effect of cluster sampling) that best predicts
    held-out environments. Rows of equal features are averaged first, as the paper's software
    refused duplicate inputs.

    Attributes:
        hyperparameters: Fixed ones; None: `fit` chooses those in use, `hyperparameters_`.
    """

    hyperparameters: Hyperparameters | None = None
    _chosen = ("hyperparameters",)

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        rows = average_rows(X, y, weight)
        if len(rows.X) > _MAX_ROWS:
            raise EstimateError(
                f"an exact Gaussian process takes at most {_MAX_ROWS} distinct rows, got"
                f" {len(rows.X)}; use the estimator 'knn' (--method knn)"
            )
        chosen = self.hyperparameters
        # On a busy machine OpenBLAS threads waiting for each other turned 2 s into minutes.
        with threadpool_limits(limits=1, user_api="blas"):
            if chosen is None:
                chosen = _choose_settings(X, y, weight, selection_folds(groups, len(y)))
            self._posterior = Posterior(rows, chosen, self.solution_)
        self.solution_ = self._posterior.solution
        self.hyperparameters_ = chosen

    def _values(self, X: Vector) -> Vector:
        return self._posterior.mean(X)

    def _value_and_gradient(self, x: Vector) -> tuple[float, Vector]:
        # At a kink this is the mean of the one-sided gradients.
        posterior, theta = self._posterior, self._posterior.prior.theta
        difference = x - posterior.X
        correlation = np.exp(-(np.abs(difference) @ theta))
        slope = -theta * np.sign(difference) * correlation[:, None]
        weight = posterior.prior.signal_variance * posterior.alpha
        return float(posterior.prior_mean + weight @ correlation), weight @ slope


class Posterior:
    """The process conditioned on m rows: `alpha` is C^-1 (rate - mu), `prior_mean` mu.

    `solution` has both, shape (m + 1,), and is not worked out again if it is given.
    """

    def __init__(
        self, rows: AveragedRows, prior: Hyperparameters, solution: Vector | None = None
    ) -> None:
        self.X, self.prior = rows.X, prior
        if solution is None or len(solution) != len(rows.X) + 1:
            solution = _solve(rows, prior)
        self.solution = solution
        self.alpha, self.prior_mean = solution[:-1], float(solution[-1])

    def mean(self, X: Vector) -> Vector:
        """Returns the posterior mean for queries X, shape (n, d): shape (n,)."""
        covariance = l1_correlation(self.X, X, self.prior.theta)
        covariance *= self.prior.signal_variance
        return self.prior_mean + self.alpha @ covariance


def _solve(rows: AveragedRows, prior: Hyperparameters) -> Vector:
    """Returns alpha and, last, mu of a `Posterior`, shape (m + 1,)."""
    covariance = prior.signal_variance * l1_correlation(rows.X, rows.X, prior.theta)
    noise = prior.reach_variance / rows.count + prior.noise_floor
    covariance[np.diag_indices(len(rows.X))] += noise
    factor = cho_factor(covariance, lower=True, overwrite_a=True, check_finite=False)
    targets = np.column_stack([rows.rate, np.ones(len(rows.rate))])
    weights = cho_solve(factor, targets, check_finite=False)
    mu = weights[:, 0].sum() / weights[:, 1].sum()
    return np.append(weights[:, 0] - mu * weights[:, 1], mu)


def l1_correlation(A: Vector, B: Vector, theta: Vector) -> Vector:
    """Returns correlations (n, m) of rows of A (n, d) and B (m, d), with decay theta (d,)."""
    # In place: for the starts of a PR2 these are tens of megabytes.
    result: Vector = cdist(A * theta, B * theta, "cityblock")
    np.negative(result, out=result)
    return np.exp(result, out=result)


def negative_log_likelihood(
    log_parameters: Vector, distances: Vector, y: Vector, noise_variance: Vector
) -> tuple[float, Vector]:
    """Returns -log p(y), up to a constant, and its gradient.

    The parameters are (theta, s, tau), shape (d + 2,); `distances` |x_i - x_j| of each feature,
    shape (d, n, n). The rates y have known variances, both of shape (n,).
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


def fit_hyperparameters(rows: AveragedRows, reach_variance: float) -> Hyperparameters:
    """Maximises the marginal likelihood by L-BFGS-B, from several initial guesses.

    All are tried on up to 300 of the rows; the best result is refined on all of them.
    """
    scale = feature_scale(rows.X)
    X, y, noise = rows.X / scale, rows.rate, reach_variance / rows.count
    num_features = X.shape[1]
    bounds = np.log([_BOUNDS["theta"]] * num_features + [_BOUNDS["signal"], _BOUNDS["floor"]])
    variance = float(np.clip(np.var(y), *_BOUNDS["signal"]))
    starts = [
        np.log([theta] * num_features + [variance, 0.1 * variance]) for theta in _THETA_STARTS
    ]
    rng = make_generator("training", "rows for the search of hyper-parameters")
    few = rng.permutation(len(X))[:_MAX_SEARCH_ROWS]

    def improve(start: Vector, part: IntVector) -> tuple[float, Vector]:
        columns = X[part].T
        result = minimize(
            negative_log_likelihood,
            np.clip(start, *bounds.T),
            args=(np.abs(columns[:, :, None] - columns[:, None, :]), y[part], noise[part]),
            jac=True,
            method="L-BFGS-B",
            bounds=bounds,
        )
        return float(result.fun), np.asarray(result.x)

    _, best = min((improve(start, few) for start in starts), key=lambda found: found[0])
    if len(few) < len(X):
        _, best = improve(best, np.arange(len(X)))
    return Hyperparameters(
        theta=np.exp(best[:-2]) / scale,
        signal_variance=float(np.exp(best[-2])),
        noise_floor=float(np.exp(best[-1])),
        reach_variance=reach_variance,
    )


def _choose_settings(X: Vector, y: Vector, weight: Vector, fold: IntVector) -> Hyperparameters:
    """Returns the likeliest hyper-parameters with the best design effect, from up to 1,000 rows."""
    rows = average_rows(X, y, weight)
    if len(rows.X) > _MAX_SETTINGS_ROWS:
        order = make_generator("training", "rows for settings").permutation(len(y))
        part = order[:_MAX_SETTINGS_ROWS]
        X, y, weight, fold = X[part], y[part], weight[part], fold[part]
        rows = average_rows(X, y, weight)
    likeliest = fit_hyperparameters(rows, reach_variance(rows))
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
        seen = average_rows(X[~out], y[~out], weight[~out])
        unseen = average_rows(X[out], y[out], weight[out])
        for i, candidate in enumerate(candidates):
            predicted = Posterior(seen, candidate).mean(unseen.X)
            error[i] += unseen.count @ (unseen.rate - predicted) ** 2
    return candidates[int(np.argmin(error))]
