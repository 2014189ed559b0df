"""Tabulates second attempts after failures of LIC-1: LIC-2, where there is one, and other choices.

python scripts/second_attempts/table.py
"""

from pathlib import Path

from lic_drake.estimate.features import features_of
from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.statistics import count, mcnemar
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trials import TrialTable
from lic_drake.select.registry import IMAGINE
from scripts.common import load_trials, run_tables, write_tables

NAMES = {
    "{}": "LIC-2",
    "{}1": "LIC-1's best away from the first",
    "{}>cost": "COST away from the first",
    "{}>rnd": "RND",
    IMAGINE: "best in imagined environments",
}
"""Second choices by the method's name, given that of the estimator."""

VARIANT = IMAGINE
"""Trials of fewer goals, of what takes long."""

PR2 = "sphere-aperture-clutter"


def second_attempts_table(
    trials: TrialTable, category: str, estimator: str, variant: str = ""
) -> Table:
    """Returns success of second attempts after LIC-1 with an estimator failed.

    All choices follow the same failures and find the environment as these left it; McNemar's
    paired test compares each with LIC-2, or else with LIC-1's.

    Args:
        trials: Trials of two attempts.
        category: Clutter category.
        estimator: "gp" or "knn".
        variant: Of the trials.
    """
    failed = ~trials.success(estimator, 1, variant)
    usual = trials.success(estimator, 2, variant)[failed]
    has_lic_2 = features_of(category).second is not None
    rows = []
    for pattern, name in NAMES.items():
        method = pattern.format(estimator)
        # All of these methods have this LIC-1's first attempt, but imagine, which has the GP's.
        if method in trials.methods(variant) and (method != IMAGINE or estimator == "gp"):
            won = trials.success(method, 2, variant)[failed]
            p = "" if method == estimator else f"{mcnemar(won, usual):.2g}"
            if method == estimator and not has_lic_2:
                name = NAMES["{}1"]
            rows.append((name, *rate_cells(count(won)), p))
    return Table(
        caption=f"Second attempts in {category} after failures of LIC-1 ({estimator}) at"
        f" {len(failed):,} goals.",
        heading=(
            *("second choice", "success, %", "Wilson 90 % interval", "count"),
            f"McNemar's p against LIC-{2 if has_lic_2 else 1}",
        ),
        rows=tuple(rows),
    )


def write(results: Path) -> list[Path]:
    """Writes a table for each category and estimator, and of what was tried at fewer goals."""
    tables = []
    for category in TABLES:
        trials = load_trials(results, category)
        tables += [second_attempts_table(trials, category, name) for name in ("gp", "knn")]
        if VARIANT in trials.variants:
            tables.append(second_attempts_table(trials, category, "gp", VARIANT))
    tables.append(second_attempts_table(load_trials(results, PR2), PR2, "gp"))
    return write_tables(results, "second_attempts", tables)


if __name__ == "__main__":
    run_tables(write, __doc__)
