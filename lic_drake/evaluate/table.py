"""Tables of text as Markdown or LaTeX, and the summary of an evaluation."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lic_drake.evaluate.statistics import Count, count, mcnemar
from lic_drake.evaluate.trials import TrialTable

_ESCAPES = str.maketrans({"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"})


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells of text under headings, with remarks below.

    Attributes:
        caption: One or more sentences.
        heading: Column headings.
        rows: Cells, one for each heading; None is a horizontal line.
        remarks: Sentences below the table.
    """

    caption: str
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...] | None, ...]
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for row in self.rows:
            if row is not None and len(row) != len(self.heading):
                raise ValueError(f"{len(self.heading)} headings, but a row of {len(row)}: {row}")

    def to_markdown(self) -> str:
        """Returns caption, table and remarks as Markdown, without horizontal lines."""
        cells = [self.heading, ("---",) * len(self.heading), *(row for row in self.rows if row)]
        lines = [f"| {' | '.join(row)} |" for row in cells]
        remarks = [f"- {remark}" for remark in self.remarks]
        parts = [self.caption, "\n".join(lines), *(["\n".join(remarks)] if remarks else [])]
        return "\n\n".join(parts) + "\n"

    def to_latex(self) -> str:
        """Returns the table as a LaTeX table environment that requires no packages."""
        body = [r"\hline" if row is None else _latex_row(row) for row in self.rows]
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{latex_text(self.caption)}}}",
            rf"\begin{{tabular}}{{{'l' * len(self.heading)}}}",
            r"\hline",
            _latex_row(self.heading),
            r"\hline",
            *body,
            r"\hline",
            r"\end{tabular}",
            r"\end{table}",
        ]
        if self.remarks:
            items = [rf"\item {latex_text(remark)}" for remark in self.remarks]
            lines += [r"\begin{itemize}", *items, r"\end{itemize}"]
        return "\n".join(lines) + "\n"

    _repr_markdown_ = to_markdown  # For notebooks.


def rate_cells(result: Count, digits: int = 1) -> tuple[str, str, str]:
    """Formats a success rate and its Wilson 90 % interval in percent, and the counts.

    Without trials, rate and interval are dashes.
    """
    counts = f"{result.successes}/{result.trials}"
    if result.trials == 0:
        return "-", "-", counts
    low, high = result.interval()
    return f"{100 * result.rate:.{digits}f}", f"{100 * low:.1f}..{100 * high:.1f}", counts


def latex_text(text: str) -> str:
    """Converts text to LaTeX: escapes special characters, sets minus signs, ranges and powers."""
    text = text.translate(_ESCAPES)
    text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e(-?)\+?0*(\d+)\b", r"$\1\\times10^{\2\3}$", text)
    text = re.sub(r"(?<![\w)\-{])-(?=\d)", "$-$", text)
    return re.sub(r"(?<=\d)\.\.(?=[+$\d])", "--", text)


def _latex_row(row: tuple[str, ...]) -> str:
    return " & ".join(map(latex_text, row)) + r" \\"


@dataclass(frozen=True, kw_only=True)
class Rate:
    """A strategy's success within a number of attempts.

    `p_value` is McNemar's exact paired test against RND on the same goals; NaN for RND.
    """

    method: str
    attempts: int
    count: Count
    p_value: float


def summarize_trials(table: TrialTable, attempts: int, variant: str = "") -> list[Rate]:
    """Returns the success rate of each strategy within 1 to `attempts` attempts."""
    methods = table.methods(variant)
    rates = []
    for number in range(1, attempts + 1):
        won = {method: table.success(method, number, variant) for method in methods}
        for method in methods:
            compared = "rnd" in won and method != "rnd"
            p = mcnemar(won[method], won["rnd"]) if compared else float("nan")
            rates.append(Rate(method=method, attempts=number, count=count(won[method]), p_value=p))
    return rates


def rates_to_dicts(rates: Sequence[Rate]) -> list[dict[str, Any]]:
    """Returns the rates as plain data for JSON; NaN p-values become None."""
    return [
        {
            "method": rate.method,
            "attempts": rate.attempts,
            "successes": rate.count.successes,
            "trials": rate.count.trials,
            "interval": list(rate.count.interval()),
            "p_value": None if rate.p_value != rate.p_value else rate.p_value,
        }
        for rate in rates
    ]


def format_rates(rates: Sequence[Rate]) -> str:
    """Returns the rates as a Markdown table."""
    lines = [
        "| strategy | attempts | success, % | 90 % interval | trials | p against RND |",
        "|---|---|---|---|---|---|",
    ]
    for rate in rates:
        success, interval, _ = rate_cells(rate.count)
        p = "" if rate.p_value != rate.p_value else f"{rate.p_value:.2g}"
        lines.append(
            f"| {rate.method} | {rate.attempts} | {success} | {interval} | {rate.count.trials}"
            f" | {p} |"
        )
    return "\n".join(lines) + "\n"
