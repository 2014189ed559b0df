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


def second_attempts_table(trials: TrialTable, category: str, estimator: str) -> Table:
    """Returns success of second attempts after LIC-1 with an estimator failed.

    All choices follow the same failures and find the environment as these left it; McNemar's
    paired test compares each with LIC-2.

    Args:
        trials: Trials of two attempts.
        category: Clutter category.
        estimator: "gp" or "knn".
    """
    failed = ~trials.success(estimator, 1)
    lic_2 = trials.success(estimator, 2)[failed]
    rows = []
    for suffix, name in NAMES.items():
        # All of these methods have LIC-1's first attempt.
        method = f"{estimator}{suffix}"
        if method in trials.methods():
            won = trials.success(method, 2)[failed]
            p = f"{mcnemar(won, lic_2):.2g}" if suffix else ""
            rows.append((name, *rate_cells(count(won)), p))
    return Table(
        caption=f"Second attempts in {category} after failures of LIC-1 ({estimator}).",
        heading=(
            *("second choice", "success, %", "Wilson 90 % interval", "count"),
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
