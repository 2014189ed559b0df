from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm, ttest_ind

from lic_drake.evaluate.statistics import Count, mcnemar, paired_difference, two_sample_t_test

outcomes = st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=12)


@given(outcomes)
def test_mcnemar_is_the_share_of_exchanges_that_differ_as_much(
    pairs: list[tuple[bool, bool]],
) -> None:
    # If the strategies are alike, each pair may as well have been the other way round.
    a, b = np.array(pairs).T
    differences = (a.astype(int) - b)[a != b]
    sums = [np.dot(signs, differences) for signs in product((-1, 1), repeat=len(differences))]
    assert mcnemar(a, b) == pytest.approx(np.mean(np.abs(sums) >= abs(differences.sum())))


@given(outcomes)
def test_a_paired_difference_is_that_of_the_rates_with_two_trials_added(
    pairs: list[tuple[bool, bool]],
) -> None:
    a, b = np.array(pairs).T
    result = paired_difference(a, b)
    assert result[0] == pytest.approx(a.mean() - b.mean())
    # Half a trial of each kind, as weights of differences +1, -1, 0 and 0.
    values = np.concatenate([a.astype(float) - b, [1.0, -1.0, 0.0, 0.0]])
    weights = np.concatenate([np.ones(len(a)), np.full(4, 0.5)])
    mean = np.average(values, weights=weights)
    deviation = np.sqrt(np.average((values - mean) ** 2, weights=weights) / weights.sum())
    low, high = norm.interval(0.9, mean, deviation)
    np.testing.assert_allclose(result[1:], (max(low, -1.0), min(high, 1.0)), atol=1e-12)


def test_the_t_test_is_scipys_with_pooled_variance() -> None:
    a, b = Count(3, 7), Count(30, 41)
    zeros_and_ones = [(np.arange(c.trials) < c.successes).astype(float) for c in (a, b)]
    expected = ttest_ind(*zeros_and_ones, equal_var=True)
    found = two_sample_t_test(a, b)
    assert found == pytest.approx((expected.df, expected.statistic, expected.pvalue))
    with pytest.raises(ValueError, match="2 trials of each strategy, got 1, 9"):
        two_sample_t_test(Count(1, 1), Count(3, 9))
