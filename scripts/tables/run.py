"""Rebuilds Tables I to IV and those of the PR2, of other arms and of foliage from recorded trials.

python scripts/tables/run.py
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from lic_drake.evaluate.paper import (
    METHODS,
    TABLES,
    label,
    margins_table,
    success_table,
    t_test_table,
)
from lic_drake.evaluate.paper import (
    REMARKS as REMARKS,
)
from lic_drake.evaluate.statistics import count, mcnemar
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trials import TrialTable
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.select.registry import IMAGINE
from lic_drake.types import BoolVector
from scripts.bounds.race import reached
from scripts.common import load_trials, run_tables, write_tables
from scripts.learning_curve.collection import collection_table

NUMBERS = {
    "cylinder-clutter": 1,
    "passage-clutter": 3,
    "cylinder-aperture-clutter": 4,
}
"""The paper's tables of success by category; Table II is of the first category, too."""

ARMS = {
    "PR2": "sphere-aperture-clutter",
    "iiwa 14": "iiwa14-sphere-aperture-clutter",
    "Panda": "panda-sphere-aperture-clutter",
}
"""Folders of trials before the same boards, by arm."""

FOLIAGE = "foliage-aperture-clutter"

PARTS = (("1st attempt", 1), ("total of two", 2))
RATE_HEADS = ("success, %", "90 % interval", "count")
CEILING = "any start known to reach"
SUCCESS_HEADS = (*RATE_HEADS, "p against RND", "p against COST")


def pr2_table(trials: TrialTable, reachable: BoolVector) -> Table:
    """Returns the PR2's success before spheres, which the paper only demonstrates (V-B).

    Args:
        trials: Trials of two attempts, with the variant "still" where base and torso stay.
        reachable: Where any start is known that reaches the goal, shape (environments,).
    """
    rows: list[tuple[str, ...] | None] = []
    for variant, stand in (("", "move along the board"), ("still", "stay")):
        rows += success_rows(trials, stand, tried_before_spheres(trials, variant))
        if not variant:
            rows.append((stand, "", CEILING, *rate_cells(count(reachable)), "", ""))
    return Table(
        caption="The PR2 in sphere-aperture-clutter with 10 of 20 apertures blocked: unseen"
        " environments with a random goal each, the same for all strategies. Intervals are"
        " Wilson's, 90 %; p is McNemar's exact paired test.",
        heading=("base and torso", "attempt", "strategy", *SUCCESS_HEADS),
        rows=tuple(rows[1:]),
    )


def tried_before_spheres(trials: TrialTable, variant: str = "") -> list[tuple[str, str, str]]:
    """Returns the strategies of a variant as `success_rows` takes them."""
    names = {m: label(m) for m in METHODS} | {IMAGINE: "LIC(GP), then imagine"}
    return [(name, m, variant) for m, name in names.items() if m in trials.methods(variant)]


def oracle_table(trials: TrialTable, every: ExperienceLibrary) -> Table:
    """Returns what could be attained from where the robot stands, beside the strategies.

    Args:
        trials: Trials with the variant "still", one goal in each environment.
        every: Reaches through every open aperture in the first of these environments.
    """
    columns = every.columns()
    environments = np.unique(columns["environment"])
    succeeded = np.unique(columns["environment"][columns["success"].astype(bool)])
    oracle = np.isin(environments, succeeded)
    rows = [("", "oracle: any open aperture", *rate_cells(count(oracle)))]
    methods = [m for m in METHODS if m in trials.methods("still")]
    for part, attempts in PARTS:
        won = [trials.success(m, attempts, "still")[: len(environments)] for m in methods]
        rows += [(part, label(m), *rate_cells(count(w))) for m, w in zip(methods, won, strict=True)]
    any_of_them = count(np.any(won, axis=0))
    rows.append(("total of two", "any of the strategies", *rate_cells(any_of_them)))
    return Table(
        caption=f"The PR2 stays; the first {len(environments)} of these environments.",
        heading=("attempt", "strategy", *RATE_HEADS),
        rows=tuple(rows),
    )


def arms_table(trials: Mapping[str, TrialTable], reachable: Mapping[str, BoolVector]) -> Table:
    """Returns the success of several arms before spheres, where bases and heights move.

    Args:
        trials: Trials of two attempts by arm.
        reachable: Where any start is known that reaches the goal, shape (environments,), by arm.
    """
    rows: list[tuple[str, ...] | None] = []
    for arm, table in trials.items():
        rows += success_rows(table, arm, tried_before_spheres(table))
        rows.append((arm, "", CEILING, *rate_cells(count(reachable[arm])), "", ""))
    return Table(
        caption="Any arm in sphere-aperture-clutter with 10 of 20 apertures blocked: unseen"
        " environments with a random goal each, the same for all strategies, and for all arms as"
        " far as they go. Base or pedestal move. Intervals are Wilson's, 90 %; p is McNemar's exact"
        " paired test.",
        heading=("arm", "attempt", "strategy", *SUCCESS_HEADS),
        rows=tuple(rows[1:]),
    )


def foliage_table(trials: TrialTable, reachable: BoolVector) -> Table:
    """Returns the PR2's success before foliage, which the paper demonstrates once (V-B).

    Args:
        trials: Trials of two attempts by variant: what is known, and where it was learned.
        reachable: Where any start is known that reaches the goal, shape (environments,).
    """
    rows: list[tuple[str, ...] | None] = []
    for known, words in (("cameras", "seen by cameras"), ("known", "known")):
        strategies = [
            (f"{label(method)}{learned if method not in ('rnd', 'cost') else ''}", method, variant)
            for variant, learned in ((known, ", spheres"), (f"{known}-foliage", ", foliage"))
            for method in ("rnd", "cost", "knn", "gp")
            if method in trials.methods(variant)
        ]
        rows += success_rows(trials, words, strategies)
    rows.append((words, "", CEILING, *rate_cells(count(reachable)), "", ""))
    return Table(
        caption="The PR2 before foliage, 8 of 20 apertures covered, 2 of them in part: unseen"
        " environments with a random goal each, the same for all strategies. Base and torso move."
        " LIC learned from reaches among spheres or among foliage. With cameras, a reach is a"
        " success if it ends in the ball. Intervals are Wilson's, 90 %; p is McNemar's exact paired"
        " test.",
        heading=("apertures and goal", "attempt", "strategy", *SUCCESS_HEADS),
        rows=tuple(rows[1:]),
    )


def success_rows(
    trials: TrialTable, condition: str, strategies: Sequence[tuple[str, str, str]]
) -> list[tuple[str, ...] | None]:
    """Returns rows of first attempts and totals of two, a line before each of these parts.

    Args:
        trials: Trials of two attempts.
        condition: What the strategies have in common, the first cell.
        strategies: Name, method and variant of each.
    """
    rows: list[tuple[str, ...] | None] = []
    for part, attempts in PARTS if strategies else ():
        won = {name: trials.success(method, attempts, v) for name, method, v in strategies}
        rows.append(None)
        rows += [(condition, part, name, *success_cells(name, won)) for name in won]
    return rows


def success_cells(name: str, won: Mapping[str, BoolVector]) -> tuple[str, ...]:
    """Returns the cells of a strategy under `SUCCESS_HEADS`.

    Args:
        name: The strategy.
        won: Success of each trial by strategy, each of shape (n,), in the same trials.
    """
    against = [
        f"{mcnemar(won[name], won[other]):.2g}" if other in won and other != name else ""
        for other in (label("rnd"), label("cost"))
    ]
    return (*rate_cells(count(won[name])), *against)


def paper_tables(results: Path) -> dict[str, list[Table]]:
    """Returns the paper's tables with our numbers, and LIC's margins, by file name."""
    tables = {}
    for category, number in NUMBERS.items():
        trials, paper = load_trials(results, category), TABLES[category]
        tables[f"table_{number}"] = [success_table(trials, paper), margins_table(trials, paper)]
        if number == 1:
            tables["table_2"] = [t_test_table(trials)]
    return tables


def write(results: Path) -> list[Path]:
    """Writes all tables."""
    tables = paper_tables(results)
    there = {arm: folder for arm, folder in ARMS.items() if (results / folder).exists()}
    arms = {arm: load_trials(results, folder) for arm, folder in there.items()}
    known = {arm: reached(results, there[arm], len(table.pairs())) for arm, table in arms.items()}
    tables["table_arms"] = [arms_table(arms, known)]
    every = ExperienceLibrary(results / "bounds" / ARMS["PR2"] / "random")
    pr2 = pr2_table(arms["PR2"], known["PR2"])
    tables["table_pr2"] = [pr2, oracle_table(arms["PR2"], every), collection_table(results)]
    foliage = load_trials(results, FOLIAGE)
    reachable = reached(results, FOLIAGE, len(foliage.pairs("known")))
    tables["table_foliage"] = [foliage_table(foliage, reachable)]
    return [p for name, parts in tables.items() for p in write_tables(results, name, parts)]


if __name__ == "__main__":
    run_tables(write, __doc__)
