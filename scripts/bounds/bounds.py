"""What any choice of starts could attain, and what share of that LIC takes.

The oracle knows the environment: it succeeds where some start does. The population optimum knows
the goal only, as LIC-1 does, and each start's success rate there over environments. In sample it
is too good: a start is chosen for the luck it had in the very environments that judge it. Held
out, the other environments choose; that is a little too bad, because fewer of them choose.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lic_drake.errors import LibraryError
from lic_drake.evaluate.table import Table
from lic_drake.seeds import make_generator
from lic_drake.types import Vector
from scripts.bounds.factorial import Factorial
from scripts.bounds.optima import (
    choose_bandwidth,
    chosen_rate,
    held_out_score,
    in_sample_score,
    one_start_score,
    oracle_rate,
    pairs_of_starts,
    random_rate,
)

RESAMPLES = 2000
"""Bootstrap samples of an interval."""


@dataclass(frozen=True, kw_only=True)
class Bound:
    """A success rate with what each environment contributes.

    Attributes:
        name: What attains it.
        attempts: For how many attempts at a goal.
        by_environment: Success rate in each environment, shape (E,).
    """

    name: str
    attempts: int
    by_environment: Vector

    @property
    def rate(self) -> float:
        """Mean over the environments."""
        return float(self.by_environment.mean())

    def interval(self, confidence: float = 0.9) -> tuple[float, float]:
        """Returns the bootstrap interval of the rate, from environments drawn anew.

        Environments are drawn, not reaches, because reaches in one environment share its luck.
        The choices, of starts and bandwidth, stay as they are.
        """
        rng = make_generator("holdout", "bootstrap")
        n = len(self.by_environment)
        means = self.by_environment[rng.integers(n, size=(RESAMPLES, n))].mean(axis=1)
        low, high = np.quantile(means, [0.5 - 0.5 * confidence, 0.5 + 0.5 * confidence])
        return float(low), float(high)


def share_of_gap(rnd: float, lic: float, bound: float) -> float:
    """Returns what share of the way from RND's success rate to a bound LIC goes; NaN without one.

    Args:
        rnd: Success rate of RND.
        lic: Success rate of LIC on the same goals.
        bound: The bound there.
    """
    return (lic - rnd) / (bound - rnd) if bound > rnd else math.nan


def compute_bounds(factorial: Factorial) -> list[Bound]:
    """Returns RND's rate and the bounds above it, for one and for two attempts, in rising order.

    Two attempts find fresh copies of the environment here. The best pair of starts is what they
    attain without learning from the first one's failure.

    Raises:
        LibraryError: There is one environment only, or one start.
    """
    success, goals = factorial.success, factorial.goals
    if success.shape[0] < 2 or success.shape[2] < 2:
        raise LibraryError(
            f"bounds need 2 environments and 2 starts, got {success.shape[0]} and"
            f" {success.shape[2]}"
        )
    pairs = pairs_of_starts(success)
    bandwidth = choose_bandwidth(success, goals)
    one_start = one_start_score(success)
    bounds = [
        Bound(name="RND", attempts=1, by_environment=random_rate(success)),
        Bound(
            name="one start for all goals, held out",
            attempts=1,
            by_environment=chosen_rate(success, one_start),
        ),
    ]
    for outcomes, attempts, what in ((success, 1, "start"), (pairs, 2, "pair")):
        if attempts == 2:
            bounds.append(Bound(name="RND", attempts=2, by_environment=random_rate(success, 2)))
        scores = {"held out": held_out_score(outcomes, goals, bandwidth)}
        if factorial.has_common_goals:
            scores["in sample"] = in_sample_score(outcomes)
        bounds += [
            Bound(
                name=f"best {what} for each goal, {how}",
                attempts=attempts,
                by_environment=chosen_rate(outcomes, score),
            )
            for how, score in scores.items()
        ]
        bounds.append(Bound(name="oracle", attempts=attempts, by_environment=oracle_rate(success)))
    return bounds


def bounds_table(
    bounds: Sequence[Bound], category: str, learned: Mapping[str, Mapping[int, float]]
) -> Table:
    """Returns the bounds with the share of the gap from RND to each that strategies close.

    Args:
        bounds: As `compute_bounds` returns them.
        category: Clutter category.
        learned: Success rates of strategies on the bounds' goals, by name and number of attempts.
    """
    rnd = {bound.attempts: bound.rate for bound in bounds if bound.name == "RND"}
    rows = []
    for bound in bounds:
        low, high = bound.interval()
        shares = []
        for rates in learned.values():
            share = math.nan
            if bound.attempts in rates:
                share = share_of_gap(rnd[bound.attempts], rates[bound.attempts], bound.rate)
            shares.append("" if math.isnan(share) else f"{100.0 * share:.0f}")
        rows.append(
            (
                str(bound.attempts),
                bound.name,
                f"{100.0 * bound.rate:.1f}",
                f"{100.0 * low:.1f}..{100.0 * high:.1f}",
                *shares,
            )
        )
    n = len(bounds[0].by_environment)
    return Table(
        caption=f"Bounds in {category}, from every start at every goal in {n} environments."
        " Intervals are 90 %, from environments drawn anew.",
        heading=(
            "attempts",
            "choice",
            "success, %",
            "90 % interval",
            *(f"gap closed by {name}, %" for name in learned),
        ),
        rows=tuple(rows),
    )
