"""Success counts and tests between two strategies."""

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from lic_drake.intervals import wilson_interval
from lic_drake.types import BoolVector


class Count(NamedTuple):
    """Numbers of successes and trials."""

    successes: int
    trials: int

    @property
    def rate(self) -> float:
        """Success rate; NaN without trials."""
        return self.successes / self.trials if self.trials else math.nan

    def interval(self) -> tuple[float, float]:
        """Returns the Wilson interval of the rate, 90 %."""
        return wilson_interval(self.successes, self.trials, 0.9)


def count(success: BoolVector) -> Count:
    """Counts the successes in an array of any shape."""
    return Count(int(success.sum()), success.size)


def mcnemar(a: BoolVector, b: BoolVector) -> float:
    """Returns the p-value of McNemar's exact (binomial) test for paired successes, shape (n,)."""
    from scipy.stats import binomtest  # Takes longer to import than all else in an evaluation.

    only_a, only_b = int(np.sum(a & ~b)), int(np.sum(b & ~a))
    if only_a + only_b == 0:
        return 1.0
    return float(binomtest(only_a, only_a + only_b).pvalue)


def paired_difference(a: BoolVector, b: BoolVector) -> tuple[float, float, float]:
    """Returns the success rate of a minus that of b on the same trials, and its 90 % interval.

    The interval is Wald's with half a trial added to each of the four outcomes (Agresti and Min
    2005, "Simple improved confidence intervals for comparing matched proportions").
    """
    only_a, only_b = int(np.sum(a & ~b)), int(np.sum(b & ~a))
    n = len(a) + 2.0
    centre = (only_a - only_b) / n
    deviation = math.sqrt(((only_a + only_b + 1.0) / n - centre**2) / n)
    half_width = NormalDist().inv_cdf(0.95) * deviation
    return (
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
    """
    from scipy.stats import ttest_ind_from_stats

    if min(a.trials, b.trials) < 2:
        raise ValueError(f"a t-test needs 2 trials of each strategy, got {a.trials}, {b.trials}")
    deviations = [math.sqrt(c.rate * (1.0 - c.rate) * c.trials / (c.trials - 1)) for c in (a, b)]
    t, p = ttest_ind_from_stats(a.rate, deviations[0], a.trials, b.rate, deviations[1], b.trials)
    return TTest(a.trials + b.trials - 2, float(t), float(p))
