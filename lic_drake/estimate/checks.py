"""Checks of what is handed to an estimator, with messages that say what to do."""

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import LicError
from lic_drake.types import Vector


class EstimateError(LicError):
    """An estimator is unknown, not fitted yet, or was given unusable rows."""


def checked_rows(Z: ArrayLike, f: ArrayLike) -> tuple[Vector, Vector]:
    """Returns training rows as arrays of floats.

    Args:
        Z: Features, shape (n, d).
        f: Successes, shape (n,), each 0 or 1.

    Raises:
        EstimateError: No rows, lengths that differ, a NaN or infinity, or an f not 0 or 1.
    """
    Z = np.asarray(Z, dtype=np.float64)
    f = np.asarray(f, dtype=np.float64)
    if Z.ndim != 2 or f.shape != Z.shape[:1]:
        raise EstimateError(
            f"training rows need shapes Z (n, d) and f (n,), got {Z.shape} and {f.shape}"
        )
    if Z.size == 0:
        raise EstimateError(f"no training rows: Z has shape {Z.shape}; collect reaches first")
    unusable = ~np.isfinite(Z).all(axis=1)
    if unusable.any():
        raise EstimateError(
            f"{unusable.sum()} of {len(Z)} training rows have a feature that is NaN or infinite,"
            f" the first is row {np.argmax(unusable)}; leave them out"
        )
    not_binary = (f != 0.0) & (f != 1.0)
    if not_binary.any():
        raise EstimateError(
            f"successes must be 0 or 1, got {f[not_binary][0]} in row {np.argmax(not_binary)}"
        )
    # Adding zero makes -0.0 and 0.0 the same number, which rows are compared by.
    return Z + 0.0, f


def checked_weights(weight: ArrayLike, num_rows: int) -> Vector:
    """Returns the weights of rows, shape (num_rows,); a single one counts for all of them.

    Raises:
        EstimateError: Another number of weights than rows, or one that is not above zero.
    """
    weight = np.asarray(weight, dtype=np.float64)
    if weight.shape not in ((), (num_rows,)):
        raise EstimateError(
            f"weights need one number, or one for each of {num_rows} rows, got {weight.shape}"
        )
    if not np.all(np.isfinite(weight) & (weight > 0.0)):
        raise EstimateError(f"weights must be positive numbers, got {np.min(weight)}")
    return np.broadcast_to(weight, (num_rows,)).copy()


def checked_queries(Z: ArrayLike, num_features: int) -> Vector:
    """Returns query rows, shape (n, d), as an array of floats.

    Raises:
        EstimateError: Not d features each, or a NaN or infinity.
    """
    Z = np.asarray(Z, dtype=np.float64)
    if Z.ndim != 2 or Z.shape[1] != num_features:
        raise EstimateError(f"queries need shape (n, {num_features}), got {Z.shape}")
    if not np.isfinite(Z).all():
        raise EstimateError("queries must be finite, got NaN or infinity; check goal and start")
    return Z


def feature_scale(Z: Vector) -> Vector:
    """Returns each feature's standard deviation over the rows, shape (d,); 1 where constant."""
    scale = np.std(Z, axis=0)
    constant = scale <= 1e-12 * np.maximum(1.0, np.abs(Z).max(axis=0))
    return np.where(constant, 1.0, scale)
