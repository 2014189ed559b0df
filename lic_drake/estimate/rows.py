"""Rows that an estimator learns from: checks, averages over equal rows, and folds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import EstimateError
from lic_drake.seeds import make_generator
from lic_drake.types import IntVector, Vector


def check_rows(X: ArrayLike, y: ArrayLike) -> tuple[Vector, Vector]:
    """Returns training rows as arrays of floats.

    Args:
        X: Features, shape (n, d).
        y: Successes, shape (n,), each 0 or 1.

    Raises:
        EstimateError: No rows, mismatched lengths, a NaN or infinity, or a y other than 0 or 1.
    """
    X = np.asarray(X, dtype=np.float64)
    y = np.asarray(y, dtype=np.float64)
    if X.ndim != 2 or y.shape != X.shape[:1]:
        raise EstimateError(
            f"training rows need shapes X (n, d) and y (n,), got {X.shape} and {y.shape}"
        )
    if X.size == 0:
        raise EstimateError(f"no training rows: X has shape {X.shape}; collect reaches first")
    unusable = ~np.isfinite(X).all(axis=1)
    if unusable.any():
        raise EstimateError(
            f"{unusable.sum()} of {len(X)} training rows have a feature that is NaN or infinite,"
            f" the first is row {np.argmax(unusable)}; leave them out"
        )
    not_binary = (y != 0.0) & (y != 1.0)
    if not_binary.any():
        raise EstimateError(
            f"successes must be 0 or 1, got {y[not_binary][0]} in row {np.argmax(not_binary)}"
        )
    # Adding zero turns -0.0 into 0.0: rows are compared by their numbers.
    return X + 0.0, y


def check_weights(sample_weight: ArrayLike | None, num_rows: int) -> Vector:
    """Returns the weight of each row, shape (num_rows,); None means one each.

    Raises:
        EstimateError: Mismatched lengths, or a weight that is not positive and finite.
    """
    if sample_weight is None:
        return np.ones(num_rows)
    weight = np.asarray(sample_weight, dtype=np.float64)
    if weight.shape != (num_rows,):
        raise EstimateError(
            f"sample_weight needs one number for each of {num_rows} rows, got {weight.shape}"
        )
    if not np.all(np.isfinite(weight) & (weight > 0.0)):
        raise EstimateError(f"weights must be positive numbers, got {np.min(weight)}")
    return weight


def check_queries(X: ArrayLike, num_features: int) -> Vector:
    """Returns query rows, shape (n, d), as an array of floats.

    Raises:
        EstimateError: Another number of features than d, or a NaN or infinity.
    """
    X = np.asarray(X, dtype=np.float64)
    if X.ndim != 2 or X.shape[1] != num_features:
        raise EstimateError(f"queries need shape (n, {num_features}), got {X.shape}")
    if not np.isfinite(X).all():
        raise EstimateError("queries must be finite, got NaN or infinity; check goal and start")
    return X


def feature_scale(X: Vector) -> Vector:
    """Returns each feature's standard deviation over the rows, shape (d,); 1 where constant."""
    scale = np.std(X, axis=0)
    constant = scale <= 1e-12 * np.maximum(1.0, np.abs(X).max(axis=0))
    return np.where(constant, 1.0, scale)


@dataclass(frozen=True, kw_only=True)
class AveragedRows:
    """Distinct feature vectors with their success rates.

    A library tries every (goal, start) pair in many environments. P(success) depends on the pair
    alone, so nothing is lost if rows of the same pair become one row with a count.

    Attributes:
        X: Features, shape (m, d), in lexicographic order.
        rate: Share of successes, shape (m,).
        count: Number of reaches, or the sum of their weights, shape (m,).
        member: For each reach its index among the m, shape (n,).
    """

    X: Vector
    rate: Vector
    count: Vector
    member: IntVector


def average_rows(X: Vector, y: Vector, weight: Vector | None = None) -> AveragedRows:
    """Averages y over equal rows of X.

    Args:
        X: Features, shape (n, d).
        y: Successes, shape (n,).
        weight: How many reaches each row counts as, shape (n,); one by default.
    """
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

    It is the pooled variance within rows, so that a row of n reaches has the noise
    reach_variance / n. One variance serves all rows: with p (1 - p) / n of each row, rows that
    succeeded by luck every time would count as the most certain. One pseudo-reach with the
    variance of all reaches together keeps it above zero, and is all there is where no pair was
    tried twice.
    """
    num_reaches = rows.count.sum()
    total_rate = (rows.count @ rows.rate + 0.5) / (num_reaches + 1.0)
    within = rows.count @ (rows.rate * (1.0 - rows.rate))
    free = max(num_reaches - len(rows.count), 0.0)  # Weights below 1 could make it negative.
    return float((within + total_rate * (1.0 - total_rate)) / (free + 1.0))


def group_folds(groups: ArrayLike, max_folds: int) -> IntVector:
    """Assigns rows to folds such that no group is in two of them.

    Reaches in one environment share its luck, so that they are one group.

    Args:
        groups: Number of each row's group, shape (n,).
        max_folds: Number of folds, fewer if there are fewer groups.

    Returns:
        Fold of each row, shape (n,), from 0.

    Raises:
        EstimateError: Fewer than two folds or groups.
    """
    distinct, index = np.unique(np.asarray(groups), return_inverse=True)
    if len(distinct) < 2 or max_folds < 2:
        raise EstimateError(
            "holding out environments needs 2 or more of them and 2 or more folds,"
            f" got {len(distinct)} and {max_folds}"
        )
    # Shuffled, lest the order of a grid decide which rows share a fold.
    rank = make_generator("training", "folds").permutation(len(distinct))
    return rank[index] % min(max_folds, len(distinct))


def selection_folds(groups: ArrayLike | None, num_rows: int, max_folds: int = 5) -> IntVector:
    """Returns the folds by which an estimator chooses its own settings, shape (num_rows,).

    Without groups, or with only one, each row is its own group. A single row is fold 0.

    Raises:
        EstimateError: `groups` has another length than the rows.
    """
    rows = np.arange(num_rows)
    if groups is not None:
        given = np.asarray(groups)
        if given.shape != (num_rows,):
            raise EstimateError(
                f"groups needs one entry for each of {num_rows} rows, got {given.shape}"
            )
        if np.any(given != given[0]):
            rows = given
    return group_folds(rows, max_folds) if num_rows > 1 else np.zeros(1, dtype=np.intp)
