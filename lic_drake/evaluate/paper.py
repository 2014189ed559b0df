"""The paper's Tables I to IV as data, see paper.yaml, and with our numbers beside the paper's.

Park, Kapusta, Kim, Rehg and Kemp, "Learning to Reach into the Unknown: Selecting Initial Conditions
When Reaching in Clutter", section VI-B.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from lic_drake.config import read_mapping
from lic_drake.evaluate.statistics import (
    Count,
    TTest,
    count,
    mcnemar,
    paired_difference,
    two_sample_t_test,
)
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trials import TrialTable
from lic_drake.types import BoolVector

LABELS = {"rnd": "RND", "cost": "COST", "gp": "LIC(GP)", "knn": "LIC(K-NN)"}
"""The paper's names of the strategies, in the order of its columns."""
BASELINES = ("rnd", "cost")
"""The paper's baseline strategies."""
LEARNED = ("gp", "knn")
"""The paper's LIC strategies, by estimator."""
METHODS = (*BASELINES, *LEARNED)
"""All strategies of the paper, in the order of its tables."""

_PARTS = {"1st attempt": "first", "2nd attempt": "second", "total": "total"}


def label(method: str) -> str:
    """Returns the paper's name of a strategy, or else its own."""
    return LABELS.get(method, method)


@dataclass(frozen=True, kw_only=True)
class PaperColumn:
    """A strategy's column in Table I, III or IV; `percent` holds the rates as printed."""

    first: Count
    second: Count
    total: Count
    percent: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """Table I, III or IV, by strategy; `trials` is their number in the caption's words."""

    number: str
    category: str
    trials: str
    columns: dict[str, PaperColumn]


@dataclass(frozen=True, kw_only=True)
class Remark:
    """An error or omission of the paper, in the table numbered `place` or else in its "text"."""

    place: str
    text: str


def _table(data: dict[str, Any]) -> PaperTable:
    columns = {
        method: PaperColumn(
            percent=tuple(column["percent"]),
            **{part: Count(*column[part]) for part in _PARTS.values()},
        )
        for method, column in data["columns"].items()
    }
    return PaperTable(**{**data, "columns": columns})


_DATA = read_mapping(Path(__file__).with_name("paper.yaml").read_bytes(), "paper.yaml")

TABLES: dict[str, PaperTable] = {table["category"]: _table(table) for table in _DATA["tables"]}
"""Tables I, III and IV, success rates, by clutter category."""

TABLE_II = {tuple(t["pair"]): TTest(t["df"], t["t"], t["p"]) for t in _DATA["t_tests"]}
"""Table II, "paired sample t-tests in cylinder-clutter", by pair of strategies."""

REMARKS = tuple(Remark(**remark) for remark in _DATA["remarks"])
"""Caveats for comparisons with the paper; our tests check every number in them."""


def success_table(trials: TrialTable, paper: PaperTable) -> Table:
    """Returns Table I, III or IV without the strategies that have no trials."""
    methods = _tried(trials, METHODS)
    rows: list[tuple[str, ...] | None] = []
    for part in _PARTS:
        if rows:
            rows.append(None)
        paired = part != "2nd attempt"
        for i, method in enumerate(methods):
            won = _success(trials, method, part)
            ours = count(won) if paired else trials.conditional(method, 2)
            theirs = _part(paper, method, part)
            left = methods[:i] if paired else ()
            tests = [
                _format_p(mcnemar(won, _success(trials, other, part))) if other in left else ""
                for other in BASELINES
            ]
            cells = (*_cells(ours), *(_cells(theirs) if theirs else ("-", "-")), *tests)
            rows.append((part, label(method), *cells))
    n = len(trials.pairs())
    tried = f" ({paper.trials})" if paper.trials else ""
    return Table(
        caption=f"Table {paper.number}. Success rates of two consecutive attempts in"
        f" {paper.category}: ours on {n} goals that all strategies share, the paper's{tried} by its"
        " counts. Second attempts are those of the trials whose first one failed. Intervals are"
        " Wilson's, 90 %; p is McNemar's exact paired test.",
        heading=(
            "attempt",
            "strategy",
            "ours, %",
            "90 % interval",
            "paper, %",
            "90 % interval, paper",
            "p against RND",
            "p against COST",
        ),
        rows=tuple(rows),
        remarks=tuple(remark.text for remark in REMARKS if remark.place == paper.number),
    )


def t_test_table(trials: TrialTable) -> Table:
    """Returns Table II: tests between strategies in cylinder-clutter, on totals of two attempts."""
    rows = []
    for (a, b), theirs in TABLE_II.items():
        won_a, won_b = trials.success(a, 2), trials.success(b, 2)
        ours = two_sample_t_test(count(won_a), count(won_b))
        cells = (*_test_cells(ours), *_test_cells(theirs), _format_p(mcnemar(won_a, won_b)))
        rows.append((f"{label(a)}, {label(b)}", *cells))
    return Table(
        caption="Table II. Tests between strategies in cylinder-clutter, on the totals of two"
        " attempts: unpaired two-sample t with pooled variance, as in the paper, and McNemar's"
        " exact test, which uses that the goals are the same.",
        heading=("strategies", "t, ours", "p", "t, paper", "p", "p of McNemar's test, ours"),
        rows=tuple(rows),
        remarks=tuple(remark.text for remark in REMARKS if remark.place == "II"),
    )


def margins_table(trials: TrialTable, paper: PaperTable) -> Table:
    """Returns the margins of LIC over the baselines, in percentage points, ours and the paper's."""
    rows = []
    learned, baselines = _tried(trials, LEARNED), _tried(trials, BASELINES)
    for part, method, other in product(("1st attempt", "total"), learned, baselines):
        won, lost = (_success(trials, name, part) for name in (method, other))
        value, low, high = (100.0 * item for item in paired_difference(won, lost))
        a, b = (_part(paper, name, part) for name in (method, other))
        rows.append(
            (
                part,
                f"{label(method)} - {label(other)}",
                f"{value:+.2f}",
                f"{low:+.1f}..{high:+.1f}",
                f"{100.0 * (a.rate - b.rate):+.2f}" if a and b else "-",
                _format_p(mcnemar(won, lost)),
            )
        )
    return Table(
        caption=f"Margins of LIC in {paper.category}, in points of success rate. Intervals are"
        " those of paired differences (Agresti and Min), 90 %; p is McNemar's exact paired test.",
        heading=("attempt", "difference", "ours", "90 % interval", "paper", "p"),
        rows=tuple(rows),
    )


def _tried(trials: TrialTable, methods: Sequence[str]) -> list[str]:
    return [method for method in methods if method in trials.methods()]


def _success(trials: TrialTable, method: str, part: str) -> BoolVector:
    return trials.success(method, 1 if part == "1st attempt" else 2)


def _part(paper: PaperTable, method: str, part: str) -> Count | None:
    column = paper.columns.get(method)
    return None if column is None else getattr(column, _PARTS[part])


def _cells(result: Count) -> tuple[str, str]:
    rate, interval, counts = rate_cells(result, digits=2)
    return f"{rate} ({counts})", interval


def _test_cells(result: TTest) -> tuple[str, str]:
    return f"t({result.df}) = {result.t:.3f}", _format_p(result.p, 4)


def _format_p(p: float, digits: int = 2) -> str:
    return f"{p:.{digits}g}".replace("e-0", "e-")
