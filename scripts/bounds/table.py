"""Tabulates what the best choice of starts could attain, and the share that LIC attains.

python scripts/bounds/table.py

The strategies choose among the same discrete starts as the bounds do, so that their success can be
read from the same reaches.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.estimate.categories import features_of
from lic_drake.evaluate.paper import TABLES, label
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.select.baselines import corridor_cost
from lic_drake.select.objective import SuccessModel
from lic_drake.select.registry import fit_model
from lic_drake.types import Vector
from scripts.bounds.bounds import Bound, bounds_table, compute_bounds
from scripts.bounds.choices import choice_bounds, load_choices
from scripts.bounds.factorial import Factorial, load_factorial
from scripts.bounds.optima import chosen_rate
from scripts.common import run_script, write_table_files

APERTURES = "cylinder-aperture-clutter"
"""The category whose base moves."""

LEARNED = ("gp", "knn")
"""Estimators of LIC-1 in the tables."""


def bounds_tables(results: Path) -> list[Table]:
    """Returns a table of bounds for each category whose bounds were measured.

    Args:
        results: Folder of all records; `bounds/<category>/factorial` holds the reaches from all
            discrete starts, see scripts/bounds/run.py, and `bounds/<category>/trials.parquet`
            both attempts of strategies at the same goals, if there are any.

    Raises:
        LibraryError: Records are missing or damaged.
    """
    folders = {category: results / "bounds" / category / "factorial" for category in TABLES}
    return [
        _apertures_table(folder, results)
        if category == APERTURES
        else _table(category, folder, results)
        for category, folder in folders.items()
        if folder.exists()
    ]


def _table(category: str, folder: Path, results: Path) -> Table:
    factorial = load_factorial(ExperienceLibrary(folder).columns())
    scores = {"cost": _cost_score(factorial)}
    for name in LEARNED:
        scores[name] = _model_score(_first_model(name, category), factorial)
    attained = {name: chosen_rate(factorial.success, score) for name, score in scores.items()}
    both = _both_attempts(results, category)
    return _with_strategies(compute_bounds(factorial), category, attained, both)


def _apertures_table(folder: Path, results: Path) -> Table:
    columns = ExperienceLibrary(folder).columns()
    choices = load_choices(columns, features_of(APERTURES).first)
    scores = {"cost": _corridor_score(columns)}
    for name in LEARNED:
        scores[name] = _first_model(name, APERTURES).estimator.values(choices.Z)
    attained = {name: choices.chosen_rate(score) for name, score in scores.items()}
    reference = _experienced_model(results, columns).estimator.values(choices.Z)
    both = _both_attempts(results, APERTURES)
    return _with_strategies(choice_bounds(choices, reference), APERTURES, attained, both)


def _with_strategies(
    bounds: list[Bound],
    category: str,
    attained: Mapping[str, Vector],
    both: Mapping[str, Vector],
) -> Table:
    """Returns the table of bounds with strategies among them, in rising order.

    Args:
        bounds: The bounds.
        category: Clutter category.
        attained: Success rate of first attempts in each environment, shape (E,), by strategy.
        both: The same of both attempts, from all starts, not only discrete ones.
    """
    strategies = [
        Bound(name=f"{label(name)}, discrete starts", attempts=1, by_environment=rate)
        for name, rate in attained.items()
    ]
    strategies += [
        Bound(name=f"{label(name)}, LIC-1 and LIC-2", attempts=2, by_environment=rate)
        for name, rate in both.items()
    ]
    rates = {label(name): {1: float(rate.mean())} for name, rate in attained.items()}
    for name, rate in both.items():
        rates.setdefault(label(name), {})[2] = float(rate.mean())
    rising = sorted([*bounds, *strategies], key=lambda bound: (bound.attempts, bound.rate))
    return bounds_table(rising, category, rates)


def _both_attempts(results: Path, category: str) -> dict[str, Vector]:
    """Returns the success rate of two attempts in each environment, shape (E,), by estimator."""
    path = results / "bounds" / category / "trials.parquet"
    if not path.exists():
        return {}
    table = TrialTable(read_trials(path))
    environments = np.array([environment for environment, _ in table.pairs()])
    rates = {}
    for name in set(LEARNED) & set(table.methods()):
        won = table.success(name, 2)
        rates[name] = np.array([won[environments == e].mean() for e in np.unique(environments)])
    return rates


def _first_model(name: str, category: str) -> SuccessModel:
    columns = ExperienceLibrary(shipped_library(category)).columns()
    return fit_model(name, features_of(category).first, columns)


def _experienced_model(results: Path, held_out: Mapping[str, NDArray[Any]]) -> SuccessModel:
    """Returns LIC-1's model with the experience of the evaluation besides the library's."""
    library = ExperienceLibrary(shipped_library(APERTURES)).columns()
    evaluation = ExperienceLibrary(results / APERTURES / "reaches").columns()
    known = np.array([len(after) == 0 for after in evaluation["after"]])
    known &= ~np.isin(evaluation["environment"], held_out["environment"])
    columns = {
        name: np.concatenate([values, evaluation[name][known]]) for name, values in library.items()
    }
    return fit_model("knn", features_of(APERTURES).first, columns)


def _model_score(model: SuccessModel, factorial: Factorial) -> Vector:
    """Returns estimates for each environment, goal and start, shape (E, G, S)."""
    p_WG = np.concatenate([factorial.goals, np.zeros((*factorial.goals.shape[:2], 1))], axis=-1)
    Z = model.features.join(p_WG[:, :, None], factorial.starts)
    values = model.estimator.values(Z.reshape(-1, Z.shape[-1]))
    return values.reshape(Z.shape[:-1])


def _cost_score(factorial: Factorial) -> Vector:
    """Returns the negative corridor costs for each environment, goal and start, (E, G, S)."""
    goals = factorial.goals.reshape(-1, 2)
    costs = [corridor_cost(factorial.starts, np.append(goal, 0.0)) for goal in goals]
    return -np.array(costs).reshape(factorial.success.shape)


def _corridor_score(columns: Mapping[str, NDArray[Any]]) -> Vector:
    """Returns COST's score of each reach: bases break ties as in its selector, shape (n,)."""
    x0 = np.column_stack([columns[name] for name in ("start_x", "start_y", "start_phi")])
    p_WG = np.column_stack([columns[name] for name in ("goal_x", "goal_y", "goal_z")])
    cost = [corridor_cost(x0[i : i + 1], p_WG[i])[0] for i in range(len(x0))]
    aside = np.abs(columns["base_y"] - columns["goal_y"])
    score: Vector = -np.round(cost, 9) - 1e-10 * aside
    return score


def write(results: Path) -> list[Path]:
    return write_table_files(results, "bounds", bounds_tables(results))


if __name__ == "__main__":
    sys.exit(run_script(write, __doc__))
