"""Training rows: validation, averages over equal rows, and cross-validation folds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import EstimateError
from lic_drake.seeds import make_generator
from lic_drake.types import IntVector, Vector


def check_rows(X: ArrayLike, y: ArrayLike) -> tuple[Vector, Vector]:
    """Returns features, shape (n, d), and successes, shape (n,), as arrays of floats.

    Raises:
        EstimateError: No rows, mismatched lengths, a NaN or infinity, or a y other than 0 or 1.
    """
    X = np.asarray(X, dtype=np.float64)
    y = np.asarray(y, dtype=np.float64)
    if X.ndim != 2 or y.shape != X.shape[:1]:
        raise EstimateError(f"X and y need shapes (n, d) and (n,), got {X.shape} and {y.shape}")
    if X.size == 0:
        raise EstimateError(f"no training rows: X has shape {X.shape}; collect reaches first")
    unusable = ~np.isfinite(X).all(axis=1)
    if unusable.any():
        raise EstimateError(
            f"{unusable.sum()} of {len(X)} training rows contain NaN or infinity, the first is row"
            f" {np.argmax(unusable)}; leave them out"
        )
    wrong = (y != 0.0) & (y != 1.0)
    if wrong.any():
        raise EstimateError(f"successes must be 0 or 1, got {y[wrong][0]} in row {wrong.argmax()}")
    # Adding zero turns -0.0 into 0.0: rows are compared bit by bit.
    return X + 0.0, y


def check_weights(sample_weight: ArrayLike | None, num_rows: int) -> Vector:
    """Returns the weight of each row, shape (num_rows,); None means one each.

    Raises:
        EstimateError: Wrong length, or a weight that is not positive and finite.
    """
    if sample_weight is None:
        return np.ones(num_rows)
    weight = np.asarray(sample_weight, dtype=np.float64)
    if weight.shape != (num_rows,):
        raise EstimateError(f"sample_weight needs one entry a row ({num_rows}), got {weight.shape}")
    if not np.all(np.isfinite(weight) & (weight > 0.0)):
        raise EstimateError(f"weights must be positive numbers, got {np.min(weight)}")
    return weight


def check_queries(X: ArrayLike, num_features: int) -> Vector:
    """Returns query rows, shape (n, d), as an array of floats.

    Raises:
        EstimateError: Wrong number of features, or a NaN or infinity.
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

    P(success) depends on the (goal, start) pair alone, so rows of the same pair can be merged into
    one row with a count without loss.

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

    This is the pooled within-row variance; a row of n reaches has the noise variance
    reach_variance / n. Per-row estimates p (1 - p) / n would treat pairs that succeeded every time
    by luck as the most certain. One pseudo-reach with the overall variance keeps it positive.
    """
    num_reaches = rows.count.sum()
    total_rate = (rows.count @ rows.rate + 0.5) / (num_reaches + 1.0)
    within = rows.count @ (rows.rate * (1.0 - rows.rate))
    free = max(num_reaches - len(rows.count), 0.0)  # Weights below 1 could make it negative.
    return float((within + total_rate * (1.0 - total_rate)) / (free + 1.0))


def group_folds(groups: ArrayLike, max_folds: int) -> IntVector:
    """Returns the fold of each row, shape (n,), from 0, with no group split between folds.

    Args:
        groups: Group of each row, shape (n,).
        max_folds: Number of folds, fewer if there are fewer groups.

    Raises:
        EstimateError: Fewer than two folds or groups.
    """
    distinct, index = np.unique(np.asarray(groups), return_inverse=True)
    if len(distinct) < 2 or max_folds < 2:
        raise EstimateError(
            f"cross-validation needs 2 or more groups and folds, got {len(distinct)} and"
            f" {max_folds}"
        )
    # Shuffled, so that the order of a grid does not decide which rows share a fold.
    rank = make_generator("training", "folds").permutation(len(distinct))
    return rank[index] % min(max_folds, len(distinct))


def selection_folds(groups: ArrayLike | None, num_rows: int, max_folds: int = 5) -> IntVector:
    """Returns the folds by which an estimator chooses its settings, shape (num_rows,).

    Without groups, or with only one, each row is its own group. A single row is in fold 0.

    Raises:
        EstimateError: `groups` has the wrong length.
    """
    rows = np.arange(num_rows)
    if groups is not None:
        given = np.asarray(groups)
        if given.shape != (num_rows,):
            raise EstimateError(f"groups needs one entry a row ({num_rows}), got {given.shape}")
        if np.any(given != given[0]):
            rows = given
    return group_folds(rows, max_folds) if num_rows > 1 else np.zeros(1, dtype=np.intp)
