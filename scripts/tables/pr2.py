"""Success of the PR2 in sphere-aperture-clutter, which the paper only demonstrates (V-B)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.evaluate.paper import label
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.tables import METHODS
from lic_drake.evaluate.trials import TrialTable
from lic_drake.intervals import wilson_interval

STANDS = {"": "move along the board", "still": "stay"}
"""What base and torso do, by the variant of the trials."""


SUCCESS_HEADS = ("success, %", "90 % interval", "count", "p against RND", "p against COST")
"""Heads of the cells that say how a strategy did."""


def space_table(trials: TrialTable) -> Table:
    """Returns first attempts and totals of two attempts with intervals and McNemar's p.

    Args:
        trials: Trials of two attempts; variants and strategies that were not tried are left out.

    Raises:
        LibraryError: The trials are incomplete.
    """
    rows: list[tuple[str, ...] | None] = []
    for variant, stand in STANDS.items():
        methods = [m for m in METHODS if m in trials.methods(variant)]
        for part, attempts in (("1st attempt", 1), ("total of two", 2)):
            if rows and methods:
                rows.append(None)
            won = {label(m): trials.success(m, attempts, variant) for m in methods}
            rows += [(stand, part, name, *success_cells(name, won)) for name in won]
    return Table(
        caption="The PR2 in sphere-aperture-clutter with 10 of 20 apertures blocked: unseen"
        " environments with a random goal each, the same for all strategies. Intervals are"
        " Wilson's, 90 %; p is McNemar's exact paired test.",
        heading=("base and torso", "attempt", "strategy", *SUCCESS_HEADS),
        rows=tuple(rows),
    )


def oracle_table(trials: TrialTable, columns: Mapping[str, NDArray[Any]]) -> Table:
    """Returns what could be attained from where the robot stands, beside the strategies.

    Args:
        trials: Trials with the variant "still", one goal in each environment.
        columns: Reaches through every open aperture in the first of these environments.
    """
    environments = np.unique(columns["environment"])
    succeeded = np.unique(columns["environment"][columns["success"].astype(bool)])
    oracle = np.isin(environments, succeeded)
    rows = [("", "oracle: any open aperture", *_share(oracle))]
    methods = [m for m in METHODS if m in trials.methods("still")]
    for part, attempts in (("1st attempt", 1), ("total of two", 2)):
        won = [trials.success(m, attempts, "still")[: len(environments)] for m in methods]
        rows += [(part, label(m), *_share(w)) for m, w in zip(methods, won, strict=True)]
    rows.append(("total of two", "any of the strategies", *_share(np.any(won, axis=0))))
    return Table(
        caption=f"The PR2 stays; the first {len(environments)} of these environments.",
        heading=("attempt", "strategy", *SUCCESS_HEADS[:3]),
        rows=tuple(rows),
    )


def _share(won: NDArray[np.bool_]) -> tuple[str, str, str]:
    low, high = wilson_interval(int(won.sum()), len(won))
    return (
        f"{100 * won.mean():.1f}",
        f"{100 * low:.1f}..{100 * high:.1f}",
        f"{won.sum()}/{len(won)}",
    )


def success_cells(name: str, won: Mapping[str, NDArray[np.bool_]]) -> tuple[str, ...]:
    """Returns the cells of a strategy under `SUCCESS_HEADS`.

    Args:
        name: The strategy.
        won: Success of each trial by strategy, each of shape (n,), in the same trials.
    """
    mine = won[name]
    against = [
        f"{mcnemar(mine, won[other]):.2g}" if other in won and other != name else ""
        for other in (label("rnd"), label("cost"))
    ]
    return (*_share(mine), *against)
