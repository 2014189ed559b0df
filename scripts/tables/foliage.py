"""Success of the PR2 before foliage, which the paper demonstrates once on the robot (V-B)."""

from lic_drake.evaluate.paper import label
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable
from scripts.tables.pr2 import SUCCESS_HEADS, success_cells

CONDITIONS = {"cameras": "seen by cameras", "known": "known"}
"""How the robot knows apertures and goal, by the variant of the trials."""

ON_FOLIAGE = "-foliage"
"""Ending of the variant of trials whose strategies learned among foliage."""


def foliage_table(trials: TrialTable) -> Table:
    """Returns first attempts and totals of two attempts, by what is known and learned.

    Args:
        trials: Trials of two attempts; variants and strategies that were not tried are left out.

    Raises:
        LibraryError: The trials are incomplete.
    """
    rows: list[tuple[str, ...] | None] = []
    for condition, words in CONDITIONS.items():
        strategies = [
            (f"{label(method)}{learned if method not in ('rnd', 'cost') else ''}", method, variant)
            for variant, learned in (
                (condition, ", spheres"),
                (condition + ON_FOLIAGE, ", foliage"),
            )
            for method in ("rnd", "cost", "knn", "gp")
            if method in trials.methods(variant)
        ]
        for part, attempts in (("1st attempt", 1), ("total of two", 2)):
            if rows and strategies:
                rows.append(None)
            won = {name: trials.success(m, attempts, v) for name, m, v in strategies}
            rows += [(words, part, name, *success_cells(name, won)) for name in won]
    return Table(
        caption="The PR2 before foliage, 8 of 20 apertures covered, 2 of them in part: unseen"
        " environments with a random goal each, the same for all strategies. Base and torso move."
        " LIC learned from reaches among spheres or among foliage. With cameras, a reach is a"
        " success if it ends in the ball. Intervals are Wilson's, 90 %; p is McNemar's exact paired"
        " test.",
        heading=("apertures and goal", "attempt", "strategy", *SUCCESS_HEADS),
        rows=tuple(rows),
    )
