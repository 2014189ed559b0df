"""Summary of an evaluation: success rates by strategy and number of attempts."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lic_drake.evaluate.statistics import Count, count, mcnemar
from lic_drake.evaluate.table import rate_cells
from lic_drake.evaluate.trials import TrialTable


@dataclass(frozen=True, kw_only=True)
class Rate:
    """A strategy's success within a number of attempts.

    Attributes:
        method: Name of the strategy.
        attempts: How many attempts count.
        count: Trials that reached the goal, of all trials.
        p_value: McNemar's exact paired test against RND on the same goals; NaN for RND.
    """

    method: str
    attempts: int
    count: Count
    p_value: float


def summarize_trials(table: TrialTable, attempts: int, variant: str = "") -> list[Rate]:
    """Returns the success rate of each strategy after 1 to `attempts` attempts."""
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
    """Returns the rates as plain data for JSON; p-values that do not exist are None."""
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
