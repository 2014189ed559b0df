"""Made-up trials: rows from strings of outcomes; a folder of records with the paper's counts."""

import csv
import hashlib
import math
from collections.abc import Sequence
from pathlib import Path

from lic_drake.evaluate.paper import TABLES, PaperTable
from lic_drake.evaluate.trials import TrialRow, write_trials


def make_rows(
    method: str, outcomes: Sequence[str], goals: int = 1, variant: str = ""
) -> list[TrialRow]:
    """Returns the attempts of trials.

    Args:
        method: Strategy; all but rnd and cost estimate what they select.
        outcomes: One text for each trial, a digit for each attempt: 1 for success, else 0.
        goals: Goals in each environment.
        variant: As in `TrialRow`.
    """
    return [
        TrialRow(
            variant=variant,
            method=method,
            environment=i // goals,
            goal=i % goals,
            attempt=attempt,
            key=hashlib.sha256(f"{method} {i} {attempt}".encode()).hexdigest()[:16],
            success=digit == "1",
            probability=math.nan if method in ("rnd", "cost") else (i % 10) / 10.0,
            seconds=0.01 * attempt,
        )
        for i, text in enumerate(outcomes)
        for attempt, digit in enumerate(text, start=1)
    ]


def paper_rows(paper: PaperTable, goals: int) -> list[TrialRow]:
    """Returns trials with the paper's counts of first and second attempts."""
    rows = []
    for method, column in paper.columns.items():
        failures = column.second.trials - column.second.successes
        outcomes = (
            ["1"] * column.first.successes + ["01"] * column.second.successes + ["00"] * failures
        )
        rows += make_rows(method, outcomes, goals)
    return rows


def fill_records(results: Path) -> Path:
    """Writes records of every kind, with the paper's counts of trials."""
    for category, paper in TABLES.items():
        goals = 1 if category == "passage-clutter" else 10
        write_trials(results / category / "trials.parquet", paper_rows(paper, goals))
    (results / "learning_curve").mkdir()
    with (results / "learning_curve" / "learning_curve.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["estimator", "size", "value", "low", "high"])
        writer.writerows([name, n, 0.6, 0.5, 0.7] for name in ("gp", "knn") for n in (250, 1000))
    (results / "cross_validation").mkdir()
    with (results / "cross_validation" / "calibration_curves.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["estimator", "low", "high", "count", "predicted", "observed"])
        for name in ("gp", "knn", "sklearn KNN, K=5"):
            writer.writerow([name, 0.5, 0.6, 40, 0.55, 0.5])
    return results
