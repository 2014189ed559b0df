"""Tables of paired reaches as Markdown."""

from collections.abc import Sequence

import numpy as np

from lic_drake.evaluate.statistics import mcnemar
from scripts.mujoco.timing import PARTS, Timing


def make_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Returns a Markdown table."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def engine_cost(rows: Sequence[Timing], engine: str) -> tuple[float, float]:
    """Returns the medians of seconds per simulated second: whole reach, stepping alone."""
    mine = [row for row in rows if row.engine == engine and row.simulated_s > 0.0]
    whole = np.median([row.total_s / row.simulated_s for row in mine])
    stepping = np.median([row.parts["stepping"] / row.simulated_s for row in mine])
    return float(whole), float(stepping)


def engines_table(rows: Sequence[Timing], engines: Sequence[str]) -> str:
    """One line an engine: success, cost, and where the time of all its reaches goes."""
    lines = []
    for engine in engines:
        mine = [row for row in rows if row.engine == engine]
        whole, stepping = engine_cost(rows, engine)
        total = sum(row.total_s for row in mine)
        shares = [sum(row.parts[part] for row in mine) / total for part in PARTS]
        setup = np.median([row.setup_s for row in mine if row.setup_s is not None])
        lines.append(
            [
                engine,
                f"{sum(row.outcome == 'reached' for row in mine)} of {len(mine)}",
                f"{sum(row.simulated_s for row in mine):.0f}",
                f"{whole:.4f}",
                f"{stepping:.4f}",
                *(f"{100 * share:.0f}" for share in [*shares, 1.0 - sum(shares)]),
                f"{1000 * setup:.0f}",
            ]
        )
    headings = ["engine", "reached", "simulated s", "s per simulated s", "stepping alone"]
    headings += [f"{part}, %" for part in [*PARTS, "rest"]] + ["set-up, ms"]
    return make_table(headings, lines)


def pairs_table(rows: Sequence[Timing], pairs: Sequence[tuple[str, str]]) -> str:
    """One line a pair of engines: how much faster the second is, and whether outcomes agree."""
    of = {(row.engine, row.reach): row for row in rows}
    reaches = sorted({row.reach for row in rows})
    lines = []
    for first, second in pairs:
        a, b = [of[first, i] for i in reaches], [of[second, i] for i in reaches]
        began = [(x, y) for x, y in zip(a, b, strict=True) if min(x.simulated_s, y.simulated_s) > 0]
        whole = [x.total_s / x.simulated_s / (y.total_s / y.simulated_s) for x, y in began]
        stepping = [
            x.parts["stepping"] / x.simulated_s / (y.parts["stepping"] / y.simulated_s)
            for x, y in began
        ]
        won_a = np.array([x.outcome == "reached" for x in a])
        won_b = np.array([y.outcome == "reached" for y in b])
        same = sum(x.outcome == y.outcome for x, y in zip(a, b, strict=True))
        counts = [won_a & won_b, won_a & ~won_b, ~won_a & won_b, ~won_a & ~won_b]
        lines.append(
            [
                first,
                second,
                _quartiles(whole),
                _quartiles(stepping),
                *(str(int(count.sum())) for count in counts),
                f"{same} of {len(a)}",
                f"{mcnemar(won_a, won_b):.2f}",
            ]
        )
    headings = ["A", "B", "reach, A/B", "stepping, A/B", "both reached", "only A", "only B"]
    headings += ["neither", "same outcome", "McNemar p"]
    return make_table(headings, lines)


def _quartiles(ratios: Sequence[float]) -> str:
    low, middle, high = np.percentile(ratios, [25, 50, 75])
    return f"{middle:.2f} ({low:.2f}..{high:.2f})"
