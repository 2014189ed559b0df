import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lic_drake.estimate.averaging import average_rows, reach_variance


@given(
    arrays(np.int64, st.tuples(st.integers(1, 30), st.integers(1, 3)), elements=st.integers(0, 2)),
    st.randoms(use_true_random=False),
)
def test_averages_equal_those_of_pandas(Z, random) -> None:
    f = np.array([random.random() < 0.5 for _ in Z], dtype=float)
    rows = average_rows(Z.astype(float), f)
    table = pd.DataFrame(Z).assign(f=f).groupby(list(range(Z.shape[1])))["f"]
    expected = table.agg(["mean", "size"]).reset_index().to_numpy(dtype=float)
    np.testing.assert_allclose(np.column_stack([rows.Z, rows.rate, rows.count]), expected)
    np.testing.assert_array_equal(rows.Z[rows.member], Z)


def test_the_cylinder_library_has_945_distinct_pairs(world) -> None:
    library = world.library(environments=3)
    rows = average_rows(library.Z, library.f)
    assert rows.Z.shape == (945, 4)
    assert set(rows.count) == {3.0}


def test_the_variance_of_a_reach_is_that_of_the_draws_around_their_probability(world) -> None:
    library = world.library(environments=8)
    p = world.probability(world.grid())
    estimated = reach_variance(average_rows(library.Z, library.f))
    # 945 x 8 draws: the standard error of their variance is below 0.004.
    assert estimated == pytest.approx(np.mean(p * (1.0 - p)), abs=0.01)


def test_rows_that_always_succeed_are_not_free_of_noise() -> None:
    rows = average_rows(np.arange(5.0)[:, None], np.ones(5))
    assert 0.0 < reach_variance(rows) < 0.1


def test_without_repetition_the_variance_is_that_of_all_reaches() -> None:
    f = np.array([0.0, 1.0, 1.0])
    assert reach_variance(average_rows(np.arange(3.0)[:, None], f)) == 2.5 / 4.0 * 1.5 / 4.0
