"""Draws the figures from the recorded trials, each as PNG and PDF.

python scripts/tables/figures.py
python scripts/tables/figures.py success_cylinder-clutter learning_curve
"""

import csv
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lic_drake.errors import LibraryError
from lic_drake.evaluate.paper import LEARNED, METHODS, TABLES, label
from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.trials import TrialTable
from lic_drake.reach.scenario import load_scenario
from lic_drake.show.figures import save_figure
from scripts.common import add_results, load_trials, make_parser, run_script
from scripts.cross_validation.scores import CalibrationBin, calibration_curve
from scripts.learning_curve.run import LearningPoint
from scripts.tables.drawing import (
    AttemptCounts,
    draw_calibration,
    draw_learning_curve,
    draw_success_bars,
    draw_success_by_attempts,
    draw_success_by_goal,
)

FIVE_ATTEMPTS = "five-attempts"
"""Variant of the trials that go on to a fifth attempt."""


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
    path = results / "cross_validation" / "calibration_curves.csv"
    curves: dict[str, list[CalibrationBin]] = {name: [] for name in LEARNED}
    for row in _read_csv(path, "scripts/cross_validation/run.py"):
        if (name := row.pop("estimator")) in curves:
            size = int(row.pop("count"))
            numbers = {key: float(value) for key, value in row.items()}
            curves[name].append(CalibrationBin(count=size, **numbers))
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
    path = results / "learning_curve" / "learning_curve.csv"
    curves: dict[str, list[LearningPoint]] = {}
    for row in _read_csv(path, "scripts/learning_curve/run.py"):
        name, size = row.pop("estimator"), int(row.pop("size"))
        numbers = {key: float(value) for key, value in row.items()}
        curves.setdefault(name, []).append(LearningPoint(estimator=name, size=size, **numbers))
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


def _read_csv(path: Path, script: str) -> list[dict[str, str]]:
    """Returns the rows of a file that another script writes."""
    if not path.exists():
        raise LibraryError(f"there is no {path}; make it with: python {script}")
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("names", nargs="*", metavar="FIGURE", help=f"one of {', '.join(FIGURES)}")
    add_results(parser)
    args = parser.parse_args()
    if unknown := set(args.names) - set(FIGURES):
        parser.error(f"unknown figures: {', '.join(sorted(unknown))}")
    folder = args.results / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for name in args.names or FIGURES:
        figure = FIGURES[name](args.results)
        for suffix in (".png", ".pdf"):
            save_figure(figure, folder / f"{name}{suffix}")
        print(folder / f"{name}.png")


if __name__ == "__main__":
    run_script(main)
