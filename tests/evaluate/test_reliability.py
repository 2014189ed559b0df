"""Estimates calibrated at the choice, against scikit-learn and against what choices really do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit, logit
from sklearn.linear_model import LogisticRegression
from support.trial_rows import make_rows

from lic_drake.evaluate.reliability import (
    FEWEST,
    FOLDER,
    Reliability,
    choices,
    read_reliability,
    reliability_of,
)
from lic_drake.evaluate.trials import write_trials


def made_up(n: int, intercept: float, slope: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Estimates, and outcomes that are a logistic function of their logit."""
    rng = np.random.default_rng(seed)
    estimates = rng.uniform(0.05, 0.95, n)
    return estimates, rng.uniform(size=n) < expit(intercept + slope * logit(estimates))


def test_of_many_choices_it_is_the_logistic_regression_of_scikit_learn() -> None:
    estimates, successes = made_up(20_000, -0.7, 0.4)
    reliability = Reliability.fit(estimates, successes)
    other = LogisticRegression(C=1e9, tol=1e-8).fit(logit(estimates)[:, np.newaxis], successes)
    expected = [other.intercept_[0], other.coef_[0, 0]]
    np.testing.assert_allclose(reliability.weights, expected, atol=2e-3)


def test_without_choices_estimates_are_right_and_a_higher_one_never_means_less() -> None:
    estimates = np.array([0.1, 0.5, 0.9])
    none = Reliability.fit(np.empty(0), np.empty(0, dtype=bool))
    np.testing.assert_allclose(none.probabilities(estimates), estimates)
    upside_down = Reliability.fit(*made_up(500, 0.0, -1.0))
    p = upside_down.probabilities(estimates)
    assert np.all(np.diff(p) >= 0.0) and p[2] - p[0] < 1e-6


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    held = []
    for seed in range(200):
        low, high = Reliability.fit(*made_up(300, -0.5, 0.6, seed)).interval(0.8)
        held.append(low < expit(-0.5 + 0.6 * logit(0.8)) < high)
    assert 0.83 <= np.mean(held) <= 0.96


def test_it_learns_from_one_attempt_of_one_method_beside_the_library(tmp_path: Path) -> None:
    outcomes = ["1", "01", "00"] * FEWEST
    rows = make_rows("gp", outcomes) + make_rows("knn", outcomes[:9])
    rows = [replace(row, probability=0.9) for row in rows]
    assert read_reliability(tmp_path, "gp", 1) is None
    write_trials(tmp_path / FOLDER / "trials.parquet", rows)
    first, second = (read_reliability(tmp_path, "gp", attempt) for attempt in (1, 2))
    assert first is not None and second is not None
    assert (first.count, second.count) == (3 * FEWEST, 2 * FEWEST)
    assert first.probabilities(np.array([0.9])) == pytest.approx(1 / 3, abs=0.05)
    assert second.probabilities(np.array([0.9])) == pytest.approx(1 / 2, abs=0.05)
    assert reliability_of(rows, "knn", 1) is None and reliability_of(rows, "gp", 3) is None
    assert len(choices(rows, "gp", 1, "other")[0]) == 0
    assert reliability_of(make_rows("cost", outcomes), "cost", 1) is None
