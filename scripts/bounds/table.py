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
from lic_drake.evaluate.trials import TrialTable
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
    pairs_of_starts,
    random_rate,
)
from scripts.common import load_trials, run_tables, write_tables

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

    def interval(self) -> tuple[float, float]:
        """Returns the 90 % interval of the rate."""
        return interval(_resampled_means(self.by_environment))

    def share_of(self, other: "Bound") -> str:
        """Returns this rate in per cent of another one in the same environments, with interval."""
        ours, theirs = (_resampled_means(b.by_environment) for b in (self, other))
        if not theirs.all():
            return ""
        low, high = interval(ours / theirs)
        return f"{100 * self.rate / other.rate:.0f} ({100 * low:.0f}..{100 * high:.0f})"


def _resampled_means(by_environment: Vector) -> Vector:
    """Returns means over environments drawn anew, the same draws in every call, shape (RESAMPLES,).

    Environments are drawn, not reaches, because reaches in one environment are correlated. The
    choices of starts and bandwidth stay fixed.
    """
    n = len(by_environment)
    drawn = make_generator("holdout", "bootstrap").integers(n, size=(RESAMPLES, n))
    return np.asarray(by_environment[drawn].mean(axis=1))


def interval(samples: Vector) -> tuple[float, float]:
    """Returns the central 90 % of a sample."""
    low, high = np.quantile(samples, [0.05, 0.95])
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

    def bound(self, name: str, attempts: int, by_goal: Vector) -> Bound:
        """Returns a rate given by environment and goal, shape (E, G), as a mean over the goals."""
        by_environment = by_goal.mean(axis=1)
        return Bound(name=name, attempts=attempts, by_environment=by_environment)


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
    success, goals = factorial.success, factorial.goals
    bandwidth = choose_bandwidth(success, goals)
    one_start = chosen_rate(success, one_start_score(success))
    bounds = [factorial.bound("one start for all goals, held out", 1, one_start)]
    for outcomes, attempts, what in ((success, 1, "start"), (pairs_of_starts(success), 2, "pair")):
        scores = {"held out": held_out_score(outcomes, goals, bandwidth)}
        if np.all(goals == goals[0]):
            scores["in sample"] = in_sample_score(outcomes)
        bounds += [
            factorial.bound(
                f"best {what} for each goal, {how}", attempts, chosen_rate(outcomes, score)
            )
            for how, score in scores.items()
        ]
    return [*_extremes(factorial), *bounds]


def aperture_bounds(factorial: Factorial, results: Path) -> list[Bound]:
    """Returns the same where every environment has its own starts."""
    reference = factorial.arrange(_experienced_estimates(factorial.columns, results))
    best = chosen_rate(factorial.success, reference)
    name = "best start by more experience, held out"
    return [*_extremes(factorial), factorial.bound(name, 1, best)]


def _extremes(factorial: Factorial) -> list[Bound]:
    """Returns what a random start and any start attain."""
    success, tried = factorial.success, factorial.tried
    oracle = success.any(axis=2).astype(float)
    return [
        bound
        for k in (1, 2)
        for bound in (
            factorial.bound("RND", k, random_rate(success, tried, k)),
            factorial.bound("oracle", k, oracle),
        )
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
        results: Folder of all records; `bounds/<category>/random` holds reaches from all discrete
            starts to goals of the evaluation, see run.py. Both attempts of strategies are read from
            its trials.
        category: Clutter category.

    Raises:
        LibraryError: RND's first attempt differs from the evaluation's by more than chance, so that
            the bounds would not be those of the evaluation.
    """
    factorial = load_factorial(
        ExperienceLibrary(results / "bounds" / category / "random").columns()
    )
    columns = factorial.columns
    library = ExperienceLibrary(shipped_library(category)).columns()
    scores = {"cost": cost_score(columns)}
    scores |= {name: _estimates(name, category, library, columns) for name in LEARNED}
    bounds = (
        aperture_bounds(factorial, results) if category == APERTURES else compute_bounds(factorial)
    )
    strategies = {
        (label(name), 1): factorial.bound(
            f"{label(name)}, discrete starts",
            1,
            chosen_rate(factorial.success, factorial.arrange(score)),
        )
        for name, score in scores.items()
    }
    trials = load_trials(results, category)
    rnd = next(b for b in bounds if (b.name, b.attempts) == ("RND", 1))
    evaluated = float(trials.success("rnd", 1).mean())
    low, high = rnd.interval()
    if not low <= evaluated <= high:
        raise LibraryError(
            f"RND succeeds in {100 * low:.1f}..{100 * high:.1f} % of the reaches in"
            f" bounds/{category}, in {100 * evaluated:.1f} % of the evaluation; try more"
            " environments"
        )
    shape = factorial.success.shape[:2]
    strategies |= {
        (label(name), 2): factorial.bound(
            f"{label(name)}, both attempts", 2, _both_attempts(trials, name, shape)
        )
        for name in scores
    }
    return bounds_table(bounds, strategies, category)


def _both_attempts(trials: TrialTable, method: str, shape: tuple[int, ...]) -> Vector:
    """Returns the success of two attempts by environment and goal, shape (E, G)."""
    environment, goal = np.array(trials.pairs()).T
    here = (environment < shape[0]) & (goal < shape[1])
    return np.asarray(trials.success(method, 2)[here].reshape(shape).astype(float))


def bounds_table(
    bounds: Sequence[Bound], strategies: Mapping[tuple[str, int], Bound], what: str
) -> Table:
    """Returns bounds and strategies in rising order, and which share of each a strategy attains.

    Args:
        bounds: What could be attained.
        strategies: What strategies attain, by their names and numbers of attempts.
        what: Category.
    """
    names = list(dict.fromkeys(name for name, _ in strategies))
    everything = sorted([*bounds, *strategies.values()], key=lambda b: (b.attempts, b.rate))
    rows: list[tuple[str, ...] | None] = []
    for bound in everything:
        if rows and bound.attempts == 2 and rows[-1] is not None and rows[-1][0] == "1":
            rows.append(None)
        low, high = bound.interval()
        attained = (strategies.get((name, bound.attempts)) for name in names)
        rows.append(
            (
                str(bound.attempts),
                bound.name,
                f"{100.0 * bound.rate:.1f}",
                f"{100.0 * low:.1f}..{100.0 * high:.1f}",
                *("" if strategy is None else strategy.share_of(bound) for strategy in attained),
            )
        )
    n = len(bounds[0].by_environment)
    return Table(
        caption=f"Bounds in {what}: from every start at every goal in {n} environments. Intervals"
        " are 90 %, from environments drawn anew.",
        heading=(
            "attempts",
            "choice",
            "success, %",
            "90 % interval",
            *(f"of it by {name}, %" for name in names),
        ),
        rows=tuple(rows),
    )


def write(results: Path) -> list[Path]:
    """Writes the bounds that were measured."""
    tables = [
        category_table(results, category)
        for category in TABLES
        if (results / "bounds" / category).exists()
    ]
    return write_tables(results, "bounds", tables)


if __name__ == "__main__":
    run_tables(write, __doc__)
