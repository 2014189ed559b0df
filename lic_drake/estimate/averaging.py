"""Successes averaged over environments.

A library tries every (goal, start) pair in many environments. P(success) depends on the pair
alone, so nothing is lost if rows of the same pair become one row with a count.
"""

from dataclasses import dataclass

import numpy as np

from lic_drake.estimate.checks import Vector


@dataclass(frozen=True, kw_only=True)
class AveragedRows:
    """Distinct feature vectors with their rates.

    Attributes:
        Z: Features, shape (m, d), in lexicographic order.
        rate: Share of successes, shape (m,).
        count: Number of reaches, shape (m,).
    """

    Z: Vector
    rate: Vector
    count: Vector


def average_rows(Z: Vector, f: Vector) -> AveragedRows:
    """Averages f, shape (n,), over equal rows of Z, shape (n, d)."""
    order = np.lexsort(Z.T[::-1])
    sorted_Z = Z[order]
    is_first = np.r_[True, np.any(sorted_Z[1:] != sorted_Z[:-1], axis=1)]
    first = np.flatnonzero(is_first)
    count = np.diff(np.r_[first, len(Z)]).astype(float)
    rate = np.add.reduceat(f[order], first) / count
    return AveragedRows(Z=sorted_Z[first], rate=rate, count=count)


def binomial_variance(rate: Vector, count: Vector) -> Vector:
    """Returns the variance p (1 - p) / n of success rates, shape (m,).

    p is the mean of the posterior under Jeffreys' prior, (n rate + 1/2) / (n + 1), so that
    rates of 0 and 1 do not count as free of noise.
    """
    p = (count * rate + 0.5) / (count + 1.0)
    return p * (1.0 - p) / count
