"""The paper's Tables I to IV, with our numbers beside the paper's."""

from collections.abc import Sequence

from lic_drake.evaluate.paper import REMARKS, TABLE_II, PaperColumn, PaperTable, label
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

BASELINES = ("rnd", "cost")
"""The paper's baseline strategies."""
LEARNED = ("gp", "knn")
"""The paper's LIC strategies, by estimator."""
METHODS = (*BASELINES, *LEARNED)
"""All strategies of the paper, in the order of its tables."""

_PARTS = ("1st attempt", "2nd attempt", "total")


def success_table(trials: TrialTable, paper: PaperTable) -> Table:
    """Returns Table I, III or IV: first attempts, second ones after failures, and totals.

    Strategies without trials are left out.

    Raises:
        LibraryError: The trials are incomplete.
    """
    methods = _tried(trials, METHODS)
    rows: list[tuple[str, ...] | None] = []
    for part in _PARTS:
        if rows:
            rows.append(None)
        for method in methods:
            theirs = _part(paper.columns.get(method), part)
            rows.append(
                (
                    part,
                    label(method),
                    *_cells(_count(trials, method, part)),
                    *(_cells(theirs) if theirs else ("-", "-")),
                    *(_p_against(trials, method, other, part) for other in BASELINES),
                )
            )
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
    """Returns Table II: tests between strategies in cylinder-clutter, on totals of two attempts.

    Raises:
        LibraryError: A strategy is missing, or trials are incomplete.
    """
    rows = []
    for (a, b), theirs in TABLE_II.items():
        won_a, won_b = trials.success(a, 2), trials.success(b, 2)
        ours = two_sample_t_test(count(won_a), count(won_b))
        tests = (cell for test in (ours, theirs) for cell in _test_cells(test))
        rows.append((f"{label(a)}, {label(b)}", *tests, _format_p(mcnemar(won_a, won_b))))
    return Table(
        caption="Table II. Tests between strategies in cylinder-clutter, on the totals of two"
        " attempts: unpaired two-sample t with pooled variance, as in the paper, and McNemar's"
        " exact test, which uses that the goals are the same.",
        heading=("strategies", "t, ours", "p", "t, paper", "p", "p of McNemar's test, ours"),
        rows=tuple(rows),
        remarks=tuple(remark.text for remark in REMARKS if remark.place == "II"),
    )


def margins_table(trials: TrialTable, paper: PaperTable) -> Table:
    """Returns the margins of LIC over the baselines, in percentage points, ours and the paper's.

    Raises:
        LibraryError: The trials are incomplete.
    """
    rows = []
    for part, attempts in (("1st attempt", 1), ("total", 2)):
        for method in _tried(trials, LEARNED):
            for other in _tried(trials, BASELINES):
                value, low, high = (
                    100.0 * item
                    for item in paired_difference(
                        trials.success(method, attempts), trials.success(other, attempts)
                    )
                )
                a, b = (_part(paper.columns.get(name), part) for name in (method, other))
                rows.append(
                    (
                        part,
                        f"{label(method)} - {label(other)}",
                        f"{value:+.2f}",
                        f"{low:+.1f}..{high:+.1f}",
                        f"{100.0 * (a.rate - b.rate):+.2f}" if a and b else "-",
                        _p_against(trials, method, other, part),
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


def _count(trials: TrialTable, method: str, part: str) -> Count:
    if part == "2nd attempt":
        return trials.conditional(method, 2)
    return count(trials.success(method, 1 if part == "1st attempt" else 2))


def _part(column: PaperColumn | None, part: str) -> Count | None:
    if column is None:
        return None
    return dict(zip(_PARTS, (column.first, column.second, column.total), strict=True))[part]


def _p_against(trials: TrialTable, method: str, other: str, part: str) -> str:
    """Formats McNemar's p against a strategy to the left; second attempts are not paired."""
    is_left = METHODS.index(other) < METHODS.index(method)
    if part == "2nd attempt" or other not in trials.methods() or not is_left:
        return ""
    attempts = 1 if part == "1st attempt" else 2
    return _format_p(mcnemar(trials.success(method, attempts), trials.success(other, attempts)))


def _cells(result: Count) -> tuple[str, str]:
    rate, interval, counts = rate_cells(result, digits=2)
    return f"{rate} ({counts})", interval


def _test_cells(result: TTest) -> tuple[str, str]:
    return f"t({result.df}) = {result.t:.3f}", _format_p(result.p, 4)


def _format_p(p: float, digits: int = 2) -> str:
    return f"{p:.{digits}g}".replace("e-0", "e-")
