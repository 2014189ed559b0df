import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binomtest

from lic_drake.intervals import wilson_interval


@given(st.integers(1, 5000), st.data(), st.floats(0.5, 0.999))
def test_the_interval_is_scipys(n: int, data: st.DataObject, confidence: float) -> None:
    successes = data.draw(st.integers(0, n))
    expected = binomtest(successes, n).proportion_ci(confidence, method="wilson")
    np.testing.assert_allclose(
        wilson_interval(successes, n, confidence), (expected.low, expected.high), atol=1e-12
    )


def test_the_papers_first_reaches_have_the_half_widths_of_its_figure() -> None:
    # Table I: 1,220 of 2,000 random first reaches; Fig. 8 shows 90 % intervals of +-1.8 points.
    low, high = wilson_interval(1220, 2000)
    assert (high - low) / 2 == pytest.approx(0.0179, abs=1e-4)


def test_sure_ends_are_exact_and_no_trials_leave_every_rate_possible() -> None:
    assert wilson_interval(0, 7)[0] == 0.0
    assert wilson_interval(7, 7)[1] == 1.0
    assert wilson_interval(0, 0) == (0.0, 1.0)


@pytest.mark.parametrize(("successes", "n", "confidence"), [(-1, 3, 0.9), (4, 3, 0.9), (1, 3, 1.0)])
def test_impossible_counts_are_refused(successes: int, n: int, confidence: float) -> None:
    with pytest.raises(ValueError, match="must be"):
        wilson_interval(successes, n, confidence)
