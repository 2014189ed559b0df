"""Tables of text as Markdown or LaTeX, and the summary of an evaluation."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lic_drake.evaluate.statistics import Count, count, mcnemar
from lic_drake.evaluate.trials import TrialTable

_ESCAPES = str.maketrans({"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"})


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells of text under headings, with remarks below; a row of None is a horizontal line."""

    caption: str
    heading: tuple[str, ...]
    rows: tuple[tuple[str, ...] | None, ...]
    remarks: tuple[str, ...] = ()

    def to_markdown(self) -> str:
        """Returns caption, table and remarks as Markdown, without horizontal lines."""
        cells = [self.heading, ("---",) * len(self.heading), *(row for row in self.rows if row)]
        lines = [f"| {' | '.join(row)} |" for row in cells]
        remarks = [f"- {remark}" for remark in self.remarks]
        parts = [self.caption, "\n".join(lines), *(["\n".join(remarks)] if remarks else [])]
        return "\n\n".join(parts) + "\n"

    def to_latex(self) -> str:
        """Returns the table as a LaTeX table environment that requires no packages."""
        body = [
            r"\hline" if row is None else " & ".join(map(latex_text, row)) + r" \\"
            for row in (None, self.heading, None, *self.rows, None)
        ]
        lines = [
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{latex_text(self.caption)}}}",
            rf"\begin{{tabular}}{{{'l' * len(self.heading)}}}",
            *body,
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


def summarize_trials(table: TrialTable, attempts: int, variant: str = "") -> list[dict[str, Any]]:
    """Returns the success rate of each strategy within 1 to `attempts` attempts, for JSON.

    `p_value` is McNemar's exact paired test against RND on the same goals; None for RND.
    """
    rates = []
    for number in range(1, attempts + 1):
        won = {method: table.success(method, number, variant) for method in table.methods(variant)}
        for method, success in won.items():
            result = count(success)
            compared = "rnd" in won and method != "rnd"
            rates.append(
                {
                    "method": method,
                    "attempts": number,
                    **result._asdict(),
                    "interval": list(result.interval()),
                    "p_value": mcnemar(success, won["rnd"]) if compared else None,
                }
            )
    return rates


def format_rates(rates: Sequence[Mapping[str, Any]]) -> str:
    """Returns the rates of `summarize_trials` as a Markdown table."""
    lines = [
        "| strategy | attempts | success, % | 90 % interval | trials | p against RND |",
        "|---|---|---|---|---|---|",
    ]
    for rate in rates:
        success, interval, _ = rate_cells(Count(rate["successes"], rate["trials"]))
        p = "" if rate["p_value"] is None else f"{rate['p_value']:.2g}"
        cells = (rate["method"], rate["attempts"], success, interval, rate["trials"], p)
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines) + "\n"
