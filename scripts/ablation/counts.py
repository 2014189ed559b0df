"""Gaussian processes of success *counts*, beside the package's regression of success rates.

Both have a latent f with the L1 kernel, whose decay the package's process chooses, and P(success) =
sigmoid(f). Reaches in one environment are correlated, so counts are divided by the package's design
effect. The signal variance of f maximises the (approximate) marginal likelihood over a grid.
"""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import expit, xlogy
from threadpoolctl import threadpool_limits

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.gaussian_process import GaussianProcess, l1_correlation
from lic_drake.estimate.rows import average_rows, reach_variance
from lic_drake.types import Vector

SIGNAL_VARIANCES = (0.5, 1.0, 2.0, 4.0, 8.0)
PSEUDO_COUNT = 0.1
"""Added to the counts of either outcome, see `DirichletProcess`."""


@dataclass(eq=False, repr=False)
class CountProcess(SuccessEstimator):
    """What both have in common; a subclass conditions the latent function on counts."""

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        chosen = GaussianProcess().fit(X, y, groups, weight).hyperparameters_
        rows = average_rows(X, y, weight)
        effect = max(1.0, chosen.reach_variance / reach_variance(rows))
        wins, tries = rows.rate * rows.count / effect, rows.count / effect
        self._X, self._theta = rows.X, chosen.theta
        R = l1_correlation(rows.X, rows.X, chosen.theta)
        with threadpool_limits(limits=1, user_api="blas"):
            found = [(*self._condition(s * R, wins, tries), s) for s in SIGNAL_VARIANCES]
        _, self._mean, alpha, signal = max(found, key=lambda each: each[0])
        self._alpha = signal * alpha

    def _values(self, X: Vector) -> Vector:
        correlation = l1_correlation(self._X, X, self._theta)
        return np.asarray(expit(self._mean + self._alpha @ correlation))

    @abstractmethod
    def _condition(self, K: Vector, wins: Vector, tries: Vector) -> tuple[float, float, Vector]:
        """Returns the log likelihood, the mean of f, and K^-1 (f - mean) at its mode, shape (m,).

        K is the prior covariance, shape (m, m); wins and tries are of m rows.
        """


class DirichletProcess(CountProcess):
    """Regression of log-normal targets (Milios et al., 2018).

    Two independent processes, one for each outcome, of log gamma variables with the mean and the
    variance of a count; f is their difference.
    """

    def _condition(self, K: Vector, wins: Vector, tries: Vector) -> tuple[float, float, Vector]:
        total, mean, alpha = 0.0, 0.0, np.zeros(len(wins))
        for sign, counts in ((1.0, wins), (-1.0, tries - wins)):
            a = counts + PSEUDO_COUNT
            variance = np.log1p(1.0 / a)
            target = np.log(a) - 0.5 * variance
            lower = cho_factor(K + np.diag(variance), lower=True)
            weights = cho_solve(lower, np.column_stack([target, np.ones(len(a))]))
            mu = weights[:, 0].sum() / weights[:, 1].sum()
            weight = weights[:, 0] - mu * weights[:, 1]
            total -= 0.5 * (target - mu) @ weight + np.log(np.diagonal(lower[0])).sum()
            mean, alpha = mean + sign * mu, alpha + sign * weight
        return float(total), float(mean), alpha


class BinomialProcess(CountProcess):
    """The binomial likelihood with Laplace's approximation (Rasmussen and Williams, 3.4)."""

    def _condition(self, K: Vector, wins: Vector, tries: Vector) -> tuple[float, float, Vector]:
        rate = (wins.sum() + 0.5) / (tries.sum() + 1.0)
        mean = float(np.log(rate / (1.0 - rate)))
        g, alpha = np.zeros(len(wins)), np.zeros(len(wins))
        for _ in range(100):
            p = expit(mean + g)
            root = np.sqrt(np.maximum(tries * p * (1.0 - p), 1e-10))
            lower = cho_factor(np.eye(len(g)) + root[:, None] * K * root, lower=True)
            b = root**2 * g + wins - tries * p
            alpha = b - root * cho_solve(lower, root * (K @ b))
            step = K @ alpha - g
            g = g + step
            if np.max(np.abs(step)) < 1e-6:
                break
        p = expit(mean + g)
        fit = float(np.sum(xlogy(wins, p) + xlogy(tries - wins, 1.0 - p)))
        total = fit - 0.5 * alpha @ g - np.log(np.diagonal(lower[0])).sum()
        return float(total), mean, alpha
