"""A table of texts, written as Markdown or LaTeX, and the cells that show a success rate."""

import re
from dataclasses import dataclass

from lic_drake.evaluate.statistics import Count

_ESCAPES = str.maketrans({"&": r"\&", "%": r"\%", "_": r"\_", "#": r"\#", "$": r"\$"})


@dataclass(frozen=True, kw_only=True)
class Table:
    """Cells of text under headings, with remarks below.

    Notebooks show it by `_repr_markdown_`.

    Attributes:
        caption: What the table shows, a sentence or more.
        heading: Headings of the columns.
        rows: Cells, as many in each row as there are headings; a row of None is a line.
        remarks: Sentences that stand below the table.
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
        """Returns the caption, the table and the remarks as Markdown; lines are left out."""
        cells = [self.heading, ("---",) * len(self.heading), *(row for row in self.rows if row)]
        lines = [f"| {' | '.join(row)} |" for row in cells]
        remarks = [f"- {remark}" for remark in self.remarks]
        parts = [self.caption, "\n".join(lines), *(["\n".join(remarks)] if remarks else [])]
        return "\n\n".join(parts) + "\n"

    def to_latex(self) -> str:
        """Returns the table as a LaTeX table environment that needs no packages."""
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

    def _repr_markdown_(self) -> str:
        return self.to_markdown()


def rate_cells(result: Count, digits: int = 1) -> tuple[str, str, str]:
    """Returns a success rate and its Wilson 90 % interval in percent, and the counts, as text.

    Args:
        result: Successes and trials; without trials rate and interval are a dash.
        digits: Decimals of the rate.
    """
    counts = f"{result.successes}/{result.trials}"
    if result.trials == 0:
        return "-", "-", counts
    low, high = result.interval()
    return f"{100 * result.rate:.{digits}f}", f"{100 * low:.1f}..{100 * high:.1f}", counts


def latex_text(text: str) -> str:
    """Returns text for LaTeX: characters with a meaning escaped, minus signs, ranges, powers."""
    text = text.translate(_ESCAPES)
    text = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e(-?)\+?0*(\d+)\b", r"$\1\\times10^{\2\3}$", text)
    text = re.sub(r"(?<![\w)\-{])-(?=\d)", "$-$", text)
    return re.sub(r"(?<=\d)\.\.(?=[+$\d])", "--", text)


def _latex_row(row: tuple[str, ...]) -> str:
    return " & ".join(map(latex_text, row)) + r" \\"
