"""Success of the PR2 before foliage, which the paper demonstrates once on the robot (V-B)."""

import numpy as np
from numpy.typing import NDArray

from lic_drake.evaluate.paper import label
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable
from lic_drake.intervals import wilson_interval

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
            rows += [(words, part, name, *_figures(name, won)) for name in won]
    return Table(
        caption="The PR2 before foliage, 8 of 20 apertures covered, 2 of them in part: unseen"
        " environments with a random goal each, the same for all strategies. Base and torso move."
        " LIC learned from reaches among spheres or among foliage. With cameras, a reach is a"
        " success if it ends in the ball. Intervals are Wilson's, 90 %; p is McNemar's exact paired"
        " test.",
        heading=(
            "apertures and goal",
            "attempt",
            "strategy",
            "success, %",
            "90 % interval",
            "count",
            "p against RND",
            "p against COST",
        ),
        rows=tuple(rows),
    )


def _figures(name: str, won: dict[str, NDArray[np.bool_]]) -> tuple[str, ...]:
    """Returns the cells of a strategy."""
    mine = won[name]
    low, high = wilson_interval(int(mine.sum()), len(mine))
    against = [
        f"{mcnemar(mine, won[other]):.2g}" if other in won and other != name else ""
        for other in (label("rnd"), label("cost"))
    ]
    return (
        f"{100 * mine.mean():.1f}",
        f"{100 * low:.1f}..{100 * high:.1f}",
        f"{mine.sum()}/{len(mine)}",
        *against,
    )
