"""How often a strategy's choices succeed, given its estimates: `Reliability`.

The highest of many estimates is, on average, too high (the optimiser's curse), and a failure tells
more than a second estimate knows. So the choices of a strategy in environments that it never saw
are kept beside its library, with what became of them, and the estimate is calibrated at the choice:
a logistic function of its logit (Platt 1999), which changes no choice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit

from lic_drake.evaluate.trials import TrialRow, read_trials
from lic_drake.types import BoolVector, Vector

FOLDER = "choices"
"""Folder beside a library's reaches with the results of `lic evaluate` that are learned from."""

FEWEST = 30
"""Choices that there must be at least."""

_CLIP = 0.01
_PRIOR_MEAN = np.array([0.0, 1.0])
_PRIOR_PRECISION = np.diag([0.25, 1.0])
"""Of intercept and slope: estimates are right until choices say otherwise."""


@dataclass(frozen=True)
class Reliability:
    """The logistic function, from `count` choices.

    Attributes:
        weights: Intercept and slope, shape (2,).
        covariance: Of both, shape (2, 2).
    """

    weights: Vector
    covariance: Vector
    count: int

    @classmethod
    def fit(cls, estimates: Vector, successes: BoolVector) -> "Reliability":
        """Learns from estimates and successes of n choices, shape (n,): maximum a posteriori."""
        A = _design(estimates)

        def misfit(w: Vector) -> tuple[float, Vector]:
            z, off = A @ w, _PRIOR_PRECISION @ (w - _PRIOR_MEAN)
            value = np.sum(np.logaddexp(0.0, z) - successes * z) + 0.5 * (w - _PRIOR_MEAN) @ off
            return float(value), A.T @ (expit(z) - successes) + off

        # A higher estimate never means less.
        bounds = [(None, None), (0.0, None)]
        w = minimize(misfit, _PRIOR_MEAN, jac=True, method="L-BFGS-B", bounds=bounds).x
        p = expit(A @ w)
        hessian = (A.T * (p * (1.0 - p))) @ A + _PRIOR_PRECISION
        return cls(w, np.linalg.inv(hessian), len(A))

    def probabilities(self, estimates: Vector) -> Vector:
        """Returns the probabilities of success of choices with n estimates, shape (n,)."""
        p: Vector = expit(_design(estimates) @ self.weights)
        return p

    def interval(self, estimate: float) -> tuple[float, float]:
        """Returns the 90 % interval of the probability (Laplace's approximation)."""
        (row,) = _design(np.array([estimate]))
        half = NormalDist().inv_cdf(0.95) * np.sqrt(row @ self.covariance @ row)
        low, high = expit(row @ self.weights + np.array([-half, half]))
        return float(low), float(high)


def read_reliability(
    library: Path, method: str, attempt: int, variant: str = ""
) -> Reliability | None:
    """Returns what the choices beside a library say of an attempt; None if there are too few."""
    path = library / FOLDER / "trials.parquet"
    if not path.exists():
        return None
    return reliability_of(read_trials(path), method, attempt, variant)


def reliability_of(
    rows: Sequence[TrialRow], method: str, attempt: int, variant: str = ""
) -> Reliability | None:
    """Returns what trials say of a strategy's attempt; None if there are too few."""
    chosen = choices(rows, method, attempt, variant)
    return Reliability.fit(*chosen) if len(chosen[0]) >= FEWEST else None


def choices(
    rows: Sequence[TrialRow], method: str, attempt: int, variant: str = ""
) -> tuple[Vector, BoolVector]:
    """Returns estimates and successes of a strategy's attempts, each of shape (n,).

    There are none of a baseline, which estimates nothing.
    """
    which = (variant, method, attempt)
    found = [row for row in rows if (row.variant, row.method, row.attempt) == which]
    found = [row for row in found if not math.isnan(row.probability)]
    return np.array([row.probability for row in found]), np.array([row.success for row in found])


def _design(estimates: Vector) -> Vector:
    x = logit(np.clip(estimates, _CLIP, 1.0 - _CLIP))
    return np.column_stack([np.ones(len(x)), x])
