"""Success of the PR2 in sphere-aperture-clutter, which the paper only demonstrates (V-B)."""

from lic_drake.evaluate.paper import label
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.tables import METHODS
from lic_drake.evaluate.trials import TrialTable
from lic_drake.intervals import wilson_interval

STANDS = {"": "move along the board", "still": "stay"}
"""What base and torso do, by the variant of the trials."""


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
            for method in methods:
                won = trials.success(method, attempts, variant)
                low, high = wilson_interval(int(won.sum()), len(won))
                against = []
                for other in ("rnd", "cost"):
                    if other == method or other not in methods:
                        against.append("")
                        continue
                    p = mcnemar(won, trials.success(other, attempts, variant))
                    against.append(f"{p:.2g}")
                rows.append(
                    (
                        stand,
                        part,
                        label(method),
                        f"{100 * won.mean():.1f}",
                        f"{100 * low:.1f}..{100 * high:.1f}",
                        f"{won.sum()}/{len(won)}",
                        *against,
                    )
                )
    return Table(
        caption="The PR2 in sphere-aperture-clutter with 10 of 20 apertures blocked: unseen"
        " environments with a random goal each, the same for all strategies. Intervals are"
        " Wilson's, 90 %; p is McNemar's exact paired test.",
        heading=(
            "base and torso",
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
