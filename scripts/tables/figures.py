"""Draws the figures from the recorded trials, each as PNG and PDF.

python scripts/tables/figures.py
python scripts/tables/figures.py success_cylinder-clutter learning_curve
"""

import argparse
import csv
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lic_drake.errors import LibraryError, LicError
from lic_drake.estimate.cross_validation import CalibrationBin, calibration_curve
from lic_drake.evaluate.figures import (
    AttemptCounts,
    draw_calibration,
    draw_success_bars,
    draw_success_by_attempts,
    draw_success_by_goal,
)
from lic_drake.evaluate.paper import TABLES, label
from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.tables import LEARNED, METHODS
from lic_drake.evaluate.trials import TrialTable
from lic_drake.reach.scenario import load_scenario
from lic_drake.show.plots import save_figure
from scripts.common import RESULTS, load_trials
from scripts.learning_curve.curve import draw_learning_curve, read_learning_curves

LEARNING_CURVE = Path("learning_curve/learning_curve.csv")
"""As scripts/learning_curve/run.py writes it; below the folder of all records."""

FIVE_ATTEMPTS = "five-attempts"
"""Variant of the trials that go on to a fifth attempt."""

HELD_OUT_CALIBRATION = Path("cross_validation/calibration_curves.csv")
"""As scripts/cross_validation/run.py writes it; below the folder of all records."""


def success_figure(results: Path, category: str) -> Figure:
    """Returns success bars of a category beside the paper's (Fig. 8).

    Raises:
        LibraryError: Records are missing, damaged or incomplete; so for all figures here.
    """
    trials = load_trials(results, category)
    ours = {
        method: AttemptCounts(
            first=count(trials.success(method, 1)), total=count(trials.success(method, 2))
        )
        for method in _tried(trials)
    }
    paper = {
        method: AttemptCounts(first=column.first, total=column.total)
        for method, column in TABLES[category].columns.items()
    }
    figure = Figure(figsize=(5.5, 4.0))
    draw_success_bars(figure.subplots(), ours, paper)
    figure.suptitle(category, fontsize=11)
    return figure


def attempts_figure(results: Path, category: str) -> Figure:
    """Returns success within k attempts against k, as far as each strategy was tried."""
    trials = load_trials(results, category)
    variant = FIVE_ATTEMPTS if FIVE_ATTEMPTS in trials.variants else ""
    counts = {
        method: [
            count(trials.success(method, k, variant))
            for k in range(1, trials.max_attempts(method, variant) + 1)
        ]
        for method in METHODS
        if method in trials.methods(variant)
    }
    figure = Figure(figsize=(5.5, 4.0))
    draw_success_by_attempts(figure.subplots(), counts).set_title(category, fontsize=11)
    return figure


def calibration_figure(results: Path, category: str) -> Figure:
    """Returns observed against estimated success of the starts that LIC chose in a category."""
    trials = load_trials(results, category)
    figure = Figure(figsize=(8.5, 4.5))
    for ax, attempt, name in zip(
        figure.subplots(1, 2), (1, 2), ("first attempts", "second attempts"), strict=True
    ):
        curves = {
            method: _selected_calibration(trials, method, attempt)
            for method in _tried(trials)
            if method in LEARNED
        }
        draw_calibration(ax, {method: curve for method, curve in curves.items() if curve})
        ax.set_title(f"{category}, {name}", fontsize=10)
    return figure


def held_out_calibration_figure(results: Path) -> Figure:
    """Returns observed against predicted success in environments of the library held out."""
    curves = _read_calibration(results / HELD_OUT_CALIBRATION)
    figure = Figure(figsize=(4.5, 4.5))
    draw_calibration(figure.subplots(), curves).set_title("held-out environments", fontsize=10)
    return figure


def goals_figure(results: Path, category: str) -> Figure:
    """Returns maps of first attempts' success over the goal area, one for each strategy."""
    trials = load_trials(results, category)
    scenario = load_scenario(category)
    goals = np.array([scenario.sample_goal("evaluation", *pair)[:2] for pair in trials.pairs()])
    methods = _tried(trials)
    figure = Figure(figsize=(3.2 * len(methods), 4.5), layout="constrained")
    axes = figure.subplots(1, len(methods), squeeze=False)[0]
    for ax, method in zip(axes, methods, strict=True):
        draw_success_by_goal(ax, goals, trials.success(method, 1))
        ax.set_title(label(method), fontsize=10)
    figure.suptitle(f"{category}, first attempts", fontsize=11)
    return figure


def learning_figure(results: Path) -> Figure:
    """Returns success of the selected start against the size of the library."""
    curves = read_learning_curves(results / LEARNING_CURVE)
    figure = Figure(figsize=(5.5, 4.0))
    draw_learning_curve(figure.subplots(), curves, "success of the selected start")
    return figure


FIGURES: dict[str, Callable[[Path], Figure]] = {
    **{f"success_{category}": partial(success_figure, category=category) for category in TABLES},
    **{f"attempts_{category}": partial(attempts_figure, category=category) for category in TABLES},
    **{
        f"calibration_{category}": partial(calibration_figure, category=category)
        for category in TABLES
    },
    "calibration_held_out": held_out_calibration_figure,
    # The goals of passages lie on a line.
    **{
        f"goals_{category}": partial(goals_figure, category=category)
        for category in TABLES
        if category != "passage-clutter"
    },
    "learning_curve": learning_figure,
}
"""All figures by file name; each takes the folder of all records."""


def _tried(trials: TrialTable) -> list[str]:
    return [method for method in METHODS if method in trials.methods()]


def _selected_calibration(trials: TrialTable, method: str, attempt: int) -> list[CalibrationBin]:
    rows = [
        attempts[attempt - 1]
        for attempts in trials.trials(method).values()
        if len(attempts) >= attempt
    ]
    if not rows:
        return []
    probability = np.array([row.probability for row in rows])
    return calibration_curve(probability, np.array([float(row.success) for row in rows]))


def _read_calibration(path: Path) -> dict[str, list[CalibrationBin]]:
    """Reads the curves of LIC's estimators."""
    curves: dict[str, list[CalibrationBin]] = {name: [] for name in LEARNED}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if row["estimator"] in curves:
                    curves[row["estimator"]].append(
                        CalibrationBin(
                            low=float(row["low"]),
                            high=float(row["high"]),
                            count=int(row["count"]),
                            predicted=float(row["predicted"]),
                            observed=float(row["observed"]),
                        )
                    )
    except FileNotFoundError:
        raise LibraryError(
            f"no calibration curves at {path}; make them with: python"
            f" scripts/cross_validation/run.py models/experience/cylinder-clutter"
            f" --out {path.parent}"
        ) from None
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise LibraryError(f"{path} has no calibration curves ({error}); make it again") from None
    return curves


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=list(FIGURES), help="default: all of them")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    args = parser.parse_args()
    folder = args.results / "figures"
    failed = False
    for name in args.names or FIGURES:
        try:
            figure = FIGURES[name](args.results)
            folder.mkdir(parents=True, exist_ok=True)
            for suffix in (".png", ".pdf"):
                save_figure(figure, folder / f"{name}{suffix}")
        except LicError as error:
            print(f"error: {error}", file=sys.stderr)
            failed = True
        else:
            print(folder / f"{name}.png")
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
