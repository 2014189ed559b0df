"""Successes averaged over environments.

A library tries every (goal, start) pair in many environments. P(success) depends on the pair
alone, so nothing is lost if rows of the same pair become one row with a count.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class AveragedRows:
    """Distinct feature vectors with their rates.

    Attributes:
        Z: Features, shape (m, d), in lexicographic order.
        rate: Share of successes, shape (m,).
        count: Number of reaches, or the sum of their weights, shape (m,).
        member: Index among the m of each reach, shape (n,).
    """

    Z: Vector
    rate: Vector
    count: Vector
    member: NDArray[np.intp]


def average_rows(Z: Vector, f: Vector, weight: Vector | None = None) -> AveragedRows:
    """Averages f, shape (n,), over equal rows of Z, shape (n, d).

    Args:
        Z: Features.
        f: Successes, or rates.
        weight: How many reaches each row counts as, shape (n,), by default one.
    """
    weight = np.ones(len(Z)) if weight is None else weight
    order = np.lexsort(Z.T[::-1])
    sorted_Z = Z[order]
    is_first = np.r_[True, np.any(sorted_Z[1:] != sorted_Z[:-1], axis=1)]
    first = np.flatnonzero(is_first)
    count = np.add.reduceat(weight[order], first)
    rate = np.add.reduceat((weight * f)[order], first) / count
    member = np.empty(len(Z), dtype=np.intp)
    member[order] = np.cumsum(is_first) - 1
    return AveragedRows(Z=sorted_Z[first], rate=rate, count=count, member=member)


def reach_variance(rows: AveragedRows) -> float:
    """Returns the mean binomial variance p (1 - p) of one reach around its pair's rate.

    It is the pooled variance within rows, so that a row of n reaches has the noise
    reach_variance / n. One variance for all: with each row's own p (1 - p) / n, rows that
    succeeded by luck every time would count as the most certain. One pseudo-reach with the
    variance of all reaches together keeps it above zero, and stands alone where no pair was
    tried twice.
    """
    num_reaches = rows.count.sum()
    total_rate = (rows.count @ rows.rate + 0.5) / (num_reaches + 1.0)
    within = rows.count @ (rows.rate * (1.0 - rows.rate))
    free = num_reaches - len(rows.count)
    return float((within + total_rate * (1.0 - total_rate)) / (free + 1.0))
