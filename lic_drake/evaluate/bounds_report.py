"""The bounds of all categories as tables, from the records."""

from pathlib import Path

import numpy as np

from lic_drake.estimate.categories import features_of
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.registry import make_estimator
from lic_drake.evaluate.bounds import bounds_table, compute_bounds
from lic_drake.evaluate.choices import choice_bounds, load_choices
from lic_drake.evaluate.factorial import load_factorial
from lic_drake.evaluate.paper import TABLES, label
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library

APERTURES = "cylinder-aperture-clutter"


def bounds_tables(results: Path) -> list[Table]:
    """Returns a table of bounds for each category, with the strategies on the same goals.

    Args:
        results: Folder of all records; in `bounds/<category>` lie the reaches from all starts
            (`factorial`) and the trials at the same goals in the same environments.

    Raises:
        LibraryError: Records are missing or damaged.
    """
    tables = []
    for category in TABLES:
        folder = results / "bounds" / category
        columns = ExperienceLibrary(folder / "factorial").columns()
        if category == APERTURES:
            features = features_of(category).first
            bounds = choice_bounds(load_choices(columns, features), _reference(results))
        else:
            bounds = compute_bounds(load_factorial(columns))
        trials = TrialTable(read_trials(folder / "trials.parquet"))
        rates = {
            label(method): {k: float(trials.success(method, k).mean()) for k in (1, 2)}
            for method in ("rnd", "cost", "gp", "knn")
        }
        tables.append(bounds_table(bounds, category, rates))
    return tables


def _reference(results: Path) -> SuccessEstimator:
    """Returns LIC-1's estimator with the experience of the evaluation besides the library's."""
    library = ExperienceLibrary(shipped_library(APERTURES)).columns()
    evaluation = ExperienceLibrary(results / APERTURES / "reaches").columns()
    bounds = ExperienceLibrary(results / "bounds" / APERTURES / "factorial").columns()
    fresh = np.array([len(after) == 0 for after in evaluation["after"]])
    fresh &= ~np.isin(evaluation["environment"], bounds["environment"])
    columns = {
        name: np.concatenate([values, evaluation[name][fresh]]) for name, values in library.items()
    }
    features = features_of(APERTURES).first
    rows = features.rows(columns)
    return make_estimator("knn", features).fit(rows.Z, rows.f, rows.environment)
