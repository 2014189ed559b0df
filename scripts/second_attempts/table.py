"""Tabulates second attempts after failures of LIC-1: LIC-2 beside other choices.

python scripts/second_attempts/table.py
"""

from pathlib import Path

from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.statistics import count, mcnemar
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trials import TrialTable
from scripts.common import load_trials, run_tables, write_tables

NAMES = {
    "": "LIC-2",
    "1": "LIC-1's best away from the first",
    ">cost": "COST away from the first",
    ">rnd": "RND",
}
"""Second choices by what a method's name has after the estimator's."""

VARIANTS = {
    "": "as the first attempt left it",
    "fresh": "a fresh copy",
    "real-pairs": "as the first attempt left it; LIC-2 learned from real second attempts",
}
"""Environments that second attempts find, and how LIC-2 learned, by the trials' variant."""


def second_attempts_table(trials: TrialTable, category: str, estimator: str) -> Table:
    """Returns success of second attempts after LIC-1 with an estimator failed.

    All choices follow the same failures; McNemar's paired test compares each with LIC-2 as in the
    paper in the environment as the first attempt left it.

    Args:
        trials: Trials of two attempts.
        category: Clutter category.
        estimator: "gp" or "knn".
    """
    failed = ~trials.success(estimator, 1)
    paper = trials.success(estimator, 2)[failed]
    rows = []
    for variant, environment in VARIANTS.items():
        for suffix, name in NAMES.items():
            # LIC-1 for all attempts has LIC-1's first one.
            method = f"{estimator}{suffix}"
            if method not in trials.methods(variant):
                continue
            won = trials.success(method, 2, variant)[failed]
            p = "" if (variant, suffix) == ("", "") else f"{mcnemar(won, paper):.2g}"
            rows.append((name, environment, *rate_cells(count(won)), p))
    return Table(
        caption=f"Second attempts in {category} after failures of LIC-1 ({estimator}).",
        heading=(
            *("second choice", "environment", "success, %", "Wilson 90 % interval", "count"),
            "McNemar's p against LIC-2",
        ),
        rows=tuple(rows),
    )


def write(results: Path) -> list[Path]:
    """Writes a table for each category and estimator."""
    tables = [
        second_attempts_table(load_trials(results, category), category, estimator)
        for category in TABLES
        for estimator in ("gp", "knn")
    ]
    return write_tables(results, "second_attempts", tables)


if __name__ == "__main__":
    run_tables(write, __doc__)
