"""Folds of environments: reaches in one environment share its luck, so they stay together."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.checks import EstimateError
from lic_drake.seeds import make_generator


def environment_folds(environment: ArrayLike, max_folds: int) -> NDArray[np.intp]:
    """Assigns each row to a fold such that no environment is in two of them.

    Args:
        environment: Index of each row's environment, shape (n,).
        max_folds: Number of folds, fewer if there are fewer environments.

    Returns:
        Fold of each row, shape (n,), from 0.

    Raises:
        EstimateError: Fewer than two folds, or fewer than two environments.
    """
    distinct, index = np.unique(np.asarray(environment), return_inverse=True)
    if len(distinct) < 2 or max_folds < 2:
        raise EstimateError(
            "holding out environments needs 2 or more of them and 2 or more folds,"
            f" got {len(distinct)} and {max_folds}"
        )
    # Shuffled, lest the order of a grid decide which rows share a fold.
    rank = make_generator("training", "folds").permutation(len(distinct))
    fold: NDArray[np.intp] = rank[index] % min(max_folds, len(distinct))
    return fold


def selection_folds(
    environment: ArrayLike | None, num_rows: int, max_folds: int = 5
) -> NDArray[np.intp]:
    """Returns the folds by which an estimator chooses its own settings, shape (num_rows,).

    Where no environments are given, or one only, each row counts as an environment of its own.
    A single row is fold 0.

    Raises:
        EstimateError: `environment` has another length than the rows.
    """
    rows = np.arange(num_rows)
    if environment is not None:
        given = np.asarray(environment)
        if given.shape != (num_rows,):
            raise EstimateError(
                f"environment needs one entry for each of {num_rows} rows, got {given.shape}"
            )
        if np.any(given != given[0]):
            rows = given
    return environment_folds(rows, max_folds) if num_rows > 1 else np.zeros(1, dtype=np.intp)
