"""Success counts and tests between two strategies."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, norm
from scipy.stats import t as student_t

from lic_drake.intervals import wilson_interval


class Count(NamedTuple):
    """Numbers of successes and trials."""

    successes: int
    trials: int

    @property
    def rate(self) -> float:
        """Success rate; NaN without trials."""
        return self.successes / self.trials if self.trials else math.nan

    def interval(self, confidence: float = 0.9) -> tuple[float, float]:
        """Returns the Wilson interval of the rate."""
        return wilson_interval(self.successes, self.trials, confidence)


def count(success: NDArray[np.bool_]) -> Count:
    """Counts the successes in an array of any shape."""
    return Count(int(success.sum()), success.size)


def mcnemar(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Returns the p-value of McNemar's exact (binomial) test for paired successes, shape (n,)."""
    only_a, only_b = int(np.sum(a & ~b)), int(np.sum(b & ~a))
    if only_a + only_b == 0:
        return 1.0
    return float(binomtest(only_a, only_a + only_b).pvalue)


class Difference(NamedTuple):
    """A difference of two success rates on the same trials, with its confidence interval."""

    value: float
    low: float
    high: float


def paired_difference(
    a: NDArray[np.bool_], b: NDArray[np.bool_], confidence: float = 0.9
) -> Difference:
    """Returns the success rate of a minus that of b on the same trials, shape (n,), n > 0.

    The interval is Wald's for paired proportions with half a trial added to each of the four
    outcomes, which keeps its coverage when few trials differ (Agresti and Min 2005, "Simple
    improved confidence intervals for comparing matched proportions").
    """
    only_a, only_b = int(np.sum(a & ~b)), int(np.sum(b & ~a))
    n = len(a) + 2.0
    centre = (only_a - only_b) / n
    variance = ((only_a + only_b + 1.0) / n - centre**2) / n
    half_width = float(norm.ppf(0.5 + 0.5 * confidence)) * math.sqrt(variance)
    return Difference(
        (only_a - only_b) / len(a),
        max(-1.0, centre - half_width),
        min(1.0, centre + half_width),
    )


class TTest(NamedTuple):
    """Degrees of freedom, statistic and two-sided p-value of a t-test."""

    df: int
    t: float
    p: float


def two_sample_t_test(a: Count, b: Count) -> TTest:
    """Compares two success rates by Student's t with pooled variance, as in the paper's Table II.

    The paper calls its tests paired, but its degrees of freedom and all five values of t are those
    of this unpaired test on the totals of two attempts. `mcnemar` is paired.

    Raises:
        ValueError: Fewer than two trials of a strategy.
    """
    if min(a.trials, b.trials) < 2:
        raise ValueError(f"a t-test needs 2 trials of each strategy, got {a.trials}, {b.trials}")
    df = a.trials + b.trials - 2
    # Sum of squared deviations from the mean.
    squares = sum(item.trials * item.rate * (1.0 - item.rate) for item in (a, b))
    error = math.sqrt(squares / df * (1.0 / a.trials + 1.0 / b.trials))
    difference = a.rate - b.rate
    if error == 0.0:
        t = math.copysign(math.inf, difference) if difference else 0.0
    else:
        t = difference / error
    return TTest(df, t, float(2.0 * student_t.sf(abs(t), df)))
