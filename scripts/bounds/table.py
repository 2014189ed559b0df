"""Tabulates what the best choice of starts could attain, and the share that LIC attains.

    python scripts/bounds/table.py

The oracle knows the environment: it succeeds where some start does. The population optimum knows
the goal only, as LIC-1 does, and each start's success rate there over environments. In sample it
is optimistic, because starts are chosen and judged in the same environments. Held out, they are
chosen in the other environments, which is slightly pessimistic, because there are fewer of them.
Behind apertures each environment has its own starts; there an estimator with more experience than
LIC's stands in for the population optimum.

Strategies choose among the same discrete starts, so their success is read from the same reaches.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError
from lic_drake.estimate.features import features_of
from lic_drake.evaluate.paper import TABLES, label
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.robots.registry import get_robot
from lic_drake.seeds import make_generator
from lic_drake.select.baselines import Hand, corridor_cost
from lic_drake.select.registry import fit_model
from lic_drake.types import BoolVector, IntVector, Vector
from scripts.bounds.optima import (
    choose_bandwidth,
    chosen_rate,
    held_out_score,
    in_sample_score,
    one_start_score,
    oracle_rate,
    pairs_of_starts,
    random_rate,
)
from scripts.common import run_tables, write_tables

Columns = Mapping[str, NDArray[Any]]

APERTURES = "cylinder-aperture-clutter"
"""The category whose starts are other ones in each environment."""

LEARNED = ("gp", "knn")
"""Estimators of LIC-1 in the tables."""

RESAMPLES = 2000
"""Bootstrap samples of an interval."""


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A success rate, broken down by environment.

    Attributes:
        name: What attains it.
        attempts: For how many attempts at a goal.
        by_environment: Success rate in each environment, shape (E,).
    """

    name: str
    attempts: int
    by_environment: Vector

    @property
    def rate(self) -> float:
        """Mean over the environments."""
        return float(self.by_environment.mean())

    def interval(self, confidence: float = 0.9) -> tuple[float, float]:
        """Returns the bootstrap interval of the rate, by resampling environments.

        Environments are drawn, not reaches, because reaches in one environment are correlated.
        The choices of starts and bandwidth stay fixed.
        """
        rng = make_generator("holdout", "bootstrap")
        n = len(self.by_environment)
        means = self.by_environment[rng.integers(n, size=(RESAMPLES, n))].mean(axis=1)
        low, high = np.quantile(means, [0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
        return float(low), float(high)


@dataclass(frozen=True, kw_only=True)
class Factorial:
    """Reaches from every start at every goal of E environments with G goals each.

    Attributes:
        columns: Columns of the library.
        index: Environment, goal and start of each row, three arrays of shape (n,).
        success: Outcomes, shape (E, G, S); false where an environment has fewer than S starts.
        tried: Which starts there are, shape (E, G, S).
        goals: Goals (x, y), shape (E, G, 2), metres.
    """

    columns: Columns
    index: tuple[IntVector, IntVector, IntVector]
    success: BoolVector
    tried: BoolVector
    goals: Vector

    def arrange(self, values: Vector) -> Vector:
        """Returns values of the rows, shape (n,), by environment, goal and start; -inf for none."""
        arranged = np.full(self.success.shape, -np.inf)
        arranged[self.index] = values
        return arranged


def load_factorial(columns: Columns) -> Factorial:
    """Sorts reaches by environment, goal and start.

    Raises:
        LibraryError: A start was tried twice, environments differ in their number of goals or, but
            for apertures, of starts, or there is one environment only.
    """
    names = ("environment", "goal_x", "goal_y", "start_x", "start_y", "start_phi", "base_y")
    keys = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
    order = np.lexsort(keys.T[::-1])
    rows = keys[order]
    if np.any(np.all(rows[1:] == rows[:-1], axis=1)):
        raise LibraryError("bounds need each start at each goal once, but some were tried twice")
    first = np.r_[True, np.any(rows[1:, :3] != rows[:-1, :3], axis=1)]
    group = np.cumsum(first) - 1  # Of one environment and goal.
    environments, num_goals = np.unique(rows[first, 0], return_counts=True)
    num_starts = np.bincount(group)
    even = len(set(num_starts)) == 1 or columns["category"][0] == APERTURES
    if len(environments) < 2 or len(set(num_goals)) > 1 or not even:
        raise LibraryError(
            "bounds need 2 or more environments with as many goals and starts in each, got"
            f" {len(environments)} with {sorted(set(num_goals.tolist()))} goals and"
            f" {sorted(set(num_starts.tolist()))} starts"
        )
    shape = (len(environments), int(num_goals[0]), int(num_starts.max()))
    index = np.empty((3, len(order)), dtype=int)
    within = np.arange(len(order)) - np.flatnonzero(first)[group]
    index[:, order] = group // shape[1], group % shape[1], within
    tried, success = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
    tried[tuple(index)] = True
    success[tuple(index)] = columns["success"]
    return Factorial(
        columns=columns,
        index=(index[0], index[1], index[2]),
        success=success,
        tried=tried,
        goals=rows[first, 1:3].reshape(*shape[:2], 2),
    )


def compute_bounds(factorial: Factorial) -> list[Bound]:
    """Returns RND's rate and the bounds above it, for one and for two attempts.

    Two attempts find fresh copies of the environment here. The best pair of starts is what they
    attain without learning from the first one's failure.
    """
    success, tried, goals = factorial.success, factorial.tried, factorial.goals
    bandwidth = choose_bandwidth(success, goals)
    one_start = chosen_rate(success, one_start_score(success))
    bounds = [
        Bound(name="RND", attempts=1, by_environment=random_rate(success, tried)),
        Bound(name="one start for all goals, held out", attempts=1, by_environment=one_start),
    ]
    for outcomes, attempts, what in ((success, 1, "start"), (pairs_of_starts(success), 2, "pair")):
        if attempts == 2:
            rate = random_rate(success, tried, 2)
            bounds.append(Bound(name="RND", attempts=2, by_environment=rate))
        scores = {"held out": held_out_score(outcomes, goals, bandwidth)}
        if np.all(goals == goals[0]):
            scores["in sample"] = in_sample_score(outcomes)
        bounds += [
            Bound(
                name=f"best {what} for each goal, {how}",
                attempts=attempts,
                by_environment=chosen_rate(outcomes, score),
            )
            for how, score in scores.items()
        ]
        bounds.append(Bound(name="oracle", attempts=attempts, by_environment=oracle_rate(success)))
    return bounds


def aperture_bounds(factorial: Factorial, results: Path) -> list[Bound]:
    """Returns the same where every environment has its own starts."""
    success, tried = factorial.success, factorial.tried
    reference = factorial.arrange(_experienced_estimates(factorial.columns, results))
    oracle = oracle_rate(success)
    return [
        Bound(name="RND", attempts=1, by_environment=random_rate(success, tried)),
        Bound(
            name="best start by more experience, held out",
            attempts=1,
            by_environment=chosen_rate(success, reference),
        ),
        Bound(name="oracle", attempts=1, by_environment=oracle),
        Bound(name="RND", attempts=2, by_environment=random_rate(success, tried, 2)),
        Bound(name="oracle", attempts=2, by_environment=oracle),
    ]


def _experienced_estimates(held_out: Columns, results: Path) -> Vector:
    """Returns LIC-1's estimates after learning from the evaluation's other environments, too."""
    library = ExperienceLibrary(shipped_library(APERTURES)).columns()
    evaluation = ExperienceLibrary(results / APERTURES / "reaches").columns()
    known = np.array([len(after) == 0 for after in evaluation["after"]])
    known &= ~np.isin(evaluation["environment"], held_out["environment"])
    columns = {
        name: np.concatenate([values, evaluation[name][known]]) for name, values in library.items()
    }
    return _estimates("knn", APERTURES, columns, held_out)


def _estimates(name: str, category: str, learned: Columns, asked: Columns) -> Vector:
    """Returns what LIC-1 estimates of reaches, shape (n,), after learning from others."""
    features = features_of(category).first
    return fit_model(name, features, learned).estimator.values(features.rows(asked).X)


def cost_score(columns: Columns) -> Vector:
    """Returns COST's score of each reach: bases break ties as in its selector, shape (n,)."""
    x0 = np.column_stack([columns[name] for name in ("start_x", "start_y", "start_phi")])
    p_WG = np.column_stack([columns[name] for name in ("goal_x", "goal_y", "goal_z")])
    hand = Hand.of(get_robot("planar-arm"))
    cost = [corridor_cost(x0[i : i + 1], p_WG[i], hand)[0] for i in range(len(x0))]
    aside = np.abs(columns["base_y"] - columns["goal_y"])
    return np.asarray(-np.round(cost, 9) - 1e-10 * aside)


def category_table(results: Path, category: str) -> Table:
    """Returns the bounds of a category and what the strategies attain, in rising order.

    Args:
        results: Folder of all records; `bounds/<category>/factorial` holds reaches from all
            discrete starts, see run.py, and `bounds/<category>/trials.parquet`, if it is there,
            both attempts of strategies at the same goals.
        category: Clutter category.
    """
    folder = results / "bounds" / category
    factorial = load_factorial(ExperienceLibrary(folder / "factorial").columns())
    columns = factorial.columns
    library = ExperienceLibrary(shipped_library(category)).columns()
    scores = {"cost": cost_score(columns)}
    scores |= {name: _estimates(name, category, library, columns) for name in LEARNED}
    bounds = (
        aperture_bounds(factorial, results) if category == APERTURES else compute_bounds(factorial)
    )
    learned: dict[str, dict[int, float]] = {}
    for name, score in scores.items():
        rate = chosen_rate(factorial.success, factorial.arrange(score))
        learned[label(name)] = {1: float(rate.mean())}
        bounds.append(
            Bound(name=f"{label(name)}, discrete starts", attempts=1, by_environment=rate)
        )
    for name, rate in _both_attempts(folder / "trials.parquet").items():
        learned[label(name)][2] = float(rate.mean())
        bounds.append(
            Bound(name=f"{label(name)}, LIC-1 and LIC-2", attempts=2, by_environment=rate)
        )
    return bounds_table(
        sorted(bounds, key=lambda bound: (bound.attempts, bound.rate)), category, learned
    )


def _both_attempts(path: Path) -> dict[str, Vector]:
    """Returns the success rate of two attempts in each environment, shape (E,), by estimator."""
    if not path.exists():
        return {}
    table = TrialTable(read_trials(path))
    environments = np.array([environment for environment, _ in table.pairs()])
    rates = {}
    for name in [name for name in LEARNED if name in table.methods()]:
        won = table.success(name, 2)
        rates[name] = np.array([won[environments == e].mean() for e in np.unique(environments)])
    return rates


def bounds_table(
    bounds: Sequence[Bound], category: str, learned: Mapping[str, Mapping[int, float]]
) -> Table:
    """Returns the bounds with the share of the gap from RND to each that strategies close.

    Args:
        bounds: With RND's rates among them.
        category: Clutter category.
        learned: Success rates of strategies on the bounds' goals, by name and number of attempts.
    """
    rnd = {bound.attempts: bound.rate for bound in bounds if bound.name == "RND"}
    rows = []
    for bound in bounds:
        low, high = bound.interval()
        shares = []
        for rates in learned.values():
            share = math.nan
            if bound.attempts in rates:
                share = share_of_gap(rnd[bound.attempts], rates[bound.attempts], bound.rate)
            shares.append("" if math.isnan(share) else f"{100.0 * share:.0f}")
        rows.append(
            (
                str(bound.attempts),
                bound.name,
                f"{100.0 * bound.rate:.1f}",
                f"{100.0 * low:.1f}..{100.0 * high:.1f}",
                *shares,
            )
        )
    n = len(bounds[0].by_environment)
    return Table(
        caption=f"Bounds in {category}, from every start at every goal in {n} environments."
        " Intervals are 90 %, from environments drawn anew.",
        heading=(
            "attempts",
            "choice",
            "success, %",
            "90 % interval",
            *(f"gap closed by {name}, %" for name in learned),
        ),
        rows=tuple(rows),
    )


def share_of_gap(rnd: float, lic: float, bound: float) -> float:
    """Returns what share of the way from RND's success rate to a bound LIC goes; NaN without one.

    Args:
        rnd: Success rate of RND.
        lic: Success rate of LIC on the same goals.
        bound: The bound there.
    """
    return (lic - rnd) / (bound - rnd) if bound > rnd else math.nan


def write(results: Path) -> list[Path]:
    """Writes a table of bounds for each category whose bounds were measured."""
    measured = [c for c in TABLES if (results / "bounds" / c / "factorial").exists()]
    return write_tables(results, "bounds", [category_table(results, c) for c in measured])


if __name__ == "__main__":
    run_tables(write, __doc__)
