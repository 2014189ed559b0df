"""Training rows: validation, averages over equal rows, and cross-validation folds."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import EstimateError
from lic_drake.seeds import make_generator
from lic_drake.types import IntVector, Vector


def check_rows(
    X: ArrayLike, y: ArrayLike, groups: ArrayLike | None, sample_weight: ArrayLike | None
) -> tuple[Vector, Vector, Any, Vector]:
    """Returns the arguments of `SuccessEstimator.fit` as arrays; weights are 1 by default."""
    X, y = np.asarray(X, dtype=np.float64), np.asarray(y, dtype=np.float64)
    weight = np.ones(len(y)) if sample_weight is None else np.asarray(sample_weight, dtype=float)
    known = None if groups is None else np.asarray(groups)
    if X.ndim != 2 or y.shape != X.shape[:1]:
        raise EstimateError(f"X and y need shapes (n, d) and (n,), got {X.shape} and {y.shape}")
    if X.size == 0:
        raise EstimateError(f"no training rows: X has shape {X.shape}; collect reaches first")
    for name, given in (("groups", known), ("sample_weight", weight)):
        if given is not None and given.shape != y.shape:
            raise EstimateError(f"{name} needs one entry a row ({len(y)}), got {given.shape}")
    unusable = ~np.isfinite(X).all(axis=1)
    if unusable.any():
        raise EstimateError(
            f"{unusable.sum()} of {len(X)} training rows contain NaN or infinity, the first is row"
            f" {np.argmax(unusable)}; leave them out"
        )
    wrong = (y != 0.0) & (y != 1.0)
    if wrong.any():
        raise EstimateError(f"successes must be 0 or 1, got {y[wrong][0]} in row {wrong.argmax()}")
    if not np.all(np.isfinite(weight) & (weight > 0.0)):
        raise EstimateError(f"weights must be positive numbers, got {np.min(weight)}")
    # Adding zero turns -0.0 into 0.0: rows are compared bit by bit.
    return X + 0.0, y, known, weight


def feature_scale(X: Vector) -> Vector:
    """Returns each feature's standard deviation over the rows, shape (d,); 1 where constant."""
    scale = np.std(X, axis=0)
    constant = scale <= 1e-12 * np.maximum(1.0, np.abs(X).max(axis=0))
    return np.where(constant, 1.0, scale)


@dataclass(frozen=True, kw_only=True)
class AveragedRows:
    """Distinct feature vectors with their success rates, on which alone P(success) depends.

    Attributes:
        X: Features, shape (m, d), in lexicographic order.
        rate: Success rate, shape (m,).
        count: Sum of the reaches' weights, shape (m,).
        member: Index of each reach's pair, shape (n,).
    """

    X: Vector
    rate: Vector
    count: Vector
    member: IntVector


def average_rows(X: Vector, y: Vector, weight: Vector | None = None) -> AveragedRows:
    """Averages y, shape (n,), over equal rows of X, shape (n, d), by weight, shape (n,)."""
    weight = np.ones(len(X)) if weight is None else weight
    order = np.lexsort(X.T[::-1])
    sorted_X = X[order]
    is_first = np.r_[True, np.any(sorted_X[1:] != sorted_X[:-1], axis=1)]
    first = np.flatnonzero(is_first)
    count = np.add.reduceat(weight[order], first)
    rate = np.add.reduceat((weight * y)[order], first) / count
    member = np.empty(len(X), dtype=np.intp)
    member[order] = np.cumsum(is_first) - 1
    return AveragedRows(X=sorted_X[first], rate=rate, count=count, member=member)


def reach_variance(rows: AveragedRows) -> float:
    """Returns the mean binomial variance p (1 - p) of one reach around its pair's rate.

    It is pooled, as p (1 - p) of single pairs would make those that succeeded every time by luck
    the most certain. One pseudo-reach with the overall variance keeps it positive.
    """
    num_reaches = rows.count.sum()
    total_rate = (rows.count @ rows.rate + 0.5) / (num_reaches + 1.0)
    within = rows.count @ (rows.rate * (1.0 - rows.rate))
    free = max(num_reaches - len(rows.count), 0.0)  # Weights below 1 could make it negative.
    return float((within + total_rate * (1.0 - total_rate)) / (free + 1.0))


def group_folds(groups: ArrayLike, max_folds: int) -> IntVector:
    """Returns the fold of each row, shape (n,), from 0, with no group split between folds."""
    distinct, index = np.unique(np.asarray(groups), return_inverse=True)
    # Shuffled, so that the order of a grid does not decide which rows share a fold.
    rank = make_generator("training", "folds").permutation(len(distinct))
    return rank[index] % min(max_folds, len(distinct))


def selection_folds(groups: ArrayLike | None, num_rows: int) -> IntVector:
    """Returns the up to 5 folds by which an estimator chooses its settings, shape (num_rows,).

    Without groups, or with only one, each row is its own group.
    """
    if groups is None or len(np.unique(groups)) == 1:
        groups = np.arange(num_rows)
    return group_folds(groups, 5)
