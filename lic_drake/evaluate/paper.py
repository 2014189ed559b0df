"""The paper's Tables I to IV as data, with remarks on their errors; see paper.yaml.

Park, Kapusta, Kim, Rehg and Kemp, "Learning to Reach into the Unknown: Selecting Initial Conditions
When Reaching in Clutter", section VI-B.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lic_drake.config import read_mapping
from lic_drake.evaluate.statistics import Count, TTest

LABELS = {"rnd": "RND", "cost": "COST", "gp": "LIC(GP)", "knn": "LIC(K-NN)"}
"""The paper's names of the strategies, in the order of its columns."""


def label(method: str) -> str:
    """Returns the paper's name of a strategy, or else its own."""
    return LABELS.get(method, method)


@dataclass(frozen=True, kw_only=True)
class PaperColumn:
    """A strategy's column in Table I, III or IV.

    Attributes:
        first: First attempts.
        second: Second attempts, made after failed first ones.
        total: Trials that succeeded in either attempt.
        percent: The three rates as printed, percent.
    """

    first: Count
    second: Count
    total: Count
    percent: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PaperTable:
    """Table I, III or IV: success rates of two consecutive attempts.

    Attributes:
        number: Roman number in the paper.
        category: Clutter category.
        trials: Number of trials, in the caption's words; may be empty.
        columns: Results by strategy.
    """

    number: str
    category: str
    trials: str
    columns: dict[str, PaperColumn]


@dataclass(frozen=True, kw_only=True)
class Remark:
    """An error or omission of the paper, in the table numbered `place` or else in its "text"."""

    place: str
    text: str


def _column(data: dict[str, Any]) -> PaperColumn:
    counts = {part: Count(*data[part]) for part in ("first", "second", "total")}
    return PaperColumn(percent=tuple(data["percent"]), **counts)


def _table(data: dict[str, Any]) -> PaperTable:
    columns = {method: _column(column) for method, column in data["columns"].items()}
    return PaperTable(**{**data, "columns": columns})


_DATA = read_mapping(Path(__file__).with_name("paper.yaml").read_bytes(), "paper.yaml")

TABLES: dict[str, PaperTable] = {table["category"]: _table(table) for table in _DATA["tables"]}
"""Tables I, III and IV, success rates, by clutter category."""

TABLE_II = {tuple(t["pair"]): TTest(t["df"], t["t"], t["p"]) for t in _DATA["t_tests"]}
"""Table II, "paired sample t-tests in cylinder-clutter", by pair of strategies."""

REMARKS = tuple(Remark(**remark) for remark in _DATA["remarks"])
"""Caveats for comparisons with the paper; our tests check every number in them."""
