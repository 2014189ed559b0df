"""How good an estimate is in environments it has not seen."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import ExperienceRows
from lic_drake.estimate.rows import group_folds
from lic_drake.types import Vector

MIN_PROBABILITY = 1e-3
"""Log losses take probabilities within [1e-3, 1 - 1e-3], for all estimators alike."""


@dataclass(frozen=True, kw_only=True)
class CalibrationBin:
    """Reaches with similar predicted probability.

    Attributes:
        low: Smallest prediction of the bin.
        high: Largest prediction of the bin, itself left out but in the last bin.
        count: Number of reaches.
        predicted: Their mean prediction.
        observed: Their share of successes.
    """

    low: float
    high: float
    count: int
    predicted: float
    observed: float


@dataclass(frozen=True, kw_only=True)
class HeldOutPredictions:
    """Predictions for reaches from fits that never saw their environments.

    Attributes:
        rows: The reaches.
        probability: Predicted probability of each, shape (n,).
        constant: Success rate of the reaches each fit saw: the constant estimate, shape (n,).
    """

    rows: ExperienceRows
    probability: Vector
    constant: Vector

    def gain_by_environment(self) -> Vector:
        """Returns the log loss saved against the constant rate, one mean per environment.

        Environments are what repeats independently, so that standard errors follow from these.
        """
        gain = _log_losses(self.constant, self.rows.y) - _log_losses(self.probability, self.rows.y)
        _, index = np.unique(self.rows.groups, return_inverse=True)
        return np.bincount(index, gain) / np.bincount(index)


def hold_out_environments(
    make: Callable[[], SuccessEstimator], rows: ExperienceRows, *, folds: int = 10
) -> HeldOutPredictions:
    """Predicts every reach from a fit on the environments of the other folds.

    Args:
        make: Returns a new, unfitted estimator.
        rows: The reaches.
        folds: Number of groups of environments; with fewer environments, each on its own.

    Raises:
        EstimateError: Fewer than two environments or folds, or rows that cannot be fitted.
    """
    fold = group_folds(rows.groups, folds)
    probability, constant = np.empty(len(rows.y)), np.empty(len(rows.y))
    for held_out in range(fold.max() + 1):
        out = fold == held_out
        estimator = make().fit(rows.X[~out], rows.y[~out], rows.groups[~out])
        probability[out] = estimator.predict_proba(rows.X[out])[:, 1]
        constant[out] = rows.y[~out].mean()
    return HeldOutPredictions(rows=rows, probability=probability, constant=constant)


@dataclass(frozen=True, kw_only=True)
class Scores:
    """How good held-out predictions are.

    Attributes:
        log_loss: See `log_loss`; smaller is better.
        gain: Mean over environments of the log loss saved against the constant rate.
        gain_error: Standard error of that mean.
        brier: See `brier_score`; smaller is better.
        selected: Mean over environments of `selection_success`; larger is better.
        selected_error: Standard error of that mean.
    """

    log_loss: float
    gain: float
    gain_error: float
    brier: float
    selected: float
    selected_error: float


def score(held_out: HeldOutPredictions, situation: slice) -> Scores:
    """Returns the scores of predictions; `situation` is the part of z that is given."""
    gain = held_out.gain_by_environment()
    selected = selection_success(held_out.probability, held_out.rows, situation)
    return Scores(
        log_loss=log_loss(held_out.probability, held_out.rows.y),
        gain=float(gain.mean()),
        gain_error=_standard_error(gain),
        brier=brier_score(held_out.probability, held_out.rows.y),
        selected=float(selected.mean()),
        selected_error=_standard_error(selected),
    )


def log_loss(probability: Vector, f: Vector) -> float:
    """Returns the mean of -log of the probability given to what happened (see MIN_PROBABILITY)."""
    return float(_log_losses(probability, f).mean())


def brier_score(probability: Vector, f: Vector) -> float:
    """Returns the mean squared difference between probability and success."""
    return float(np.mean((probability - f) ** 2))


def calibration_curve(
    probability: Vector, f: Vector, *, num_bins: int = 10
) -> list[CalibrationBin]:
    """Compares predicted with observed success rates in equal bins of probability.

    Returns:
        The bins that hold any reaches, in rising order.
    """
    bin_of_row = np.minimum((probability * num_bins).astype(int), num_bins - 1)
    curve = []
    for i in np.unique(bin_of_row):
        members = bin_of_row == i
        curve.append(
            CalibrationBin(
                low=float(i / num_bins),
                high=float((i + 1) / num_bins),
                count=int(members.sum()),
                predicted=float(probability[members].mean()),
                observed=float(f[members].mean()),
            )
        )
    return curve


def selection_success(score: Vector, rows: ExperienceRows, situation: slice) -> Vector:
    """Returns the share of successes where each choice goes to the reach with the best score.

    A choice is between all reaches of the same environment and situation, so it takes a library
    that tried several starts for each. Reaches with equal scores share the choice.

    Args:
        score: Prediction for each reach, shape (n,).
        rows: The reaches.
        situation: The part of z that is given.

    Returns:
        One share per environment, in rising order of its number.
    """
    given = np.column_stack([rows.groups, rows.X[:, situation]])
    choices, choice = np.unique(given, axis=0, return_inverse=True)
    best = np.full(len(choices), -np.inf)
    np.maximum.at(best, choice, score)
    chosen = score == best[choice]
    success = np.bincount(choice[chosen], rows.y[chosen]) / np.bincount(choice[chosen])
    _, environment = np.unique(choices[:, 0], return_inverse=True)
    return np.bincount(environment, success) / np.bincount(environment)


def _log_losses(probability: Vector, f: Vector) -> Vector:
    p = np.clip(probability, MIN_PROBABILITY, 1.0 - MIN_PROBABILITY)
    return -np.where(f > 0.5, np.log(p), np.log1p(-p))


def _standard_error(values: Vector) -> float:
    return float(values.std(ddof=1) / np.sqrt(len(values)))
