import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lic_drake.errors import EstimateError
from lic_drake.estimate.rows import (
    average_rows,
    check_rows,
    group_folds,
    reach_variance,
    selection_folds,
)


@pytest.mark.parametrize(
    ("X", "y", "weight", "message"),
    [
        (np.zeros((0, 4)), np.zeros(0), None, r"no training rows.*\(0, 4\).*collect"),
        (np.zeros((2, 4)), np.zeros(3), None, r"\(2, 4\) and \(3,\)"),
        ([[0.0, 1.0], [np.nan, 0.0]], [0, 1], None, r"1 of 2 .*NaN or infinity.* row 1"),
        ([[0.0], [1.0]], [0, 0.5], None, r"0 or 1, got 0.5 in row 1"),
        ([[0.0], [1.0]], [0, 1], [1.0, 0.0], "positive numbers, got 0"),
    ],
)
def test_unusable_training_rows_are_refused_with_what_is_wrong(X, y, weight, message) -> None:
    with pytest.raises(EstimateError, match=message):
        check_rows(X, y, None, weight)


def test_booleans_become_numbers_minus_zero_becomes_zero_and_weights_are_one() -> None:
    X, y, _, weight = check_rows([[-0.0, 1.0]], [True], None, None)
    assert (y.tolist(), weight.tolist()) == ([1.0], [1.0])
    assert not np.signbit(X).any()


@given(
    arrays(np.int64, st.tuples(st.integers(1, 30), st.integers(1, 3)), elements=st.integers(0, 2)),
    st.randoms(use_true_random=False),
)
def test_averages_equal_those_of_pandas(X, random) -> None:
    y = np.array([random.random() < 0.5 for _ in X], dtype=float)
    rows = average_rows(X.astype(float), y)
    table = pd.DataFrame(X).assign(y=y).groupby(list(range(X.shape[1])))["y"]
    expected = table.agg(["mean", "size"]).reset_index().to_numpy(dtype=float)
    np.testing.assert_allclose(np.column_stack([rows.X, rows.rate, rows.count]), expected)
    np.testing.assert_array_equal(rows.X[rows.member], X)


def test_the_variance_of_a_reach_is_that_of_the_draws_around_their_probability(world) -> None:
    library = world.library(environments=8)
    p = world.probability(world.grid())
    estimated = reach_variance(average_rows(library.X, library.y))
    # 945 x 8 draws: the standard error of their variance is below 0.004.
    assert estimated == pytest.approx(np.mean(p * (1.0 - p)), abs=0.01)


@pytest.mark.parametrize("weight", [0.1, 1.0])
def test_rows_that_always_succeed_are_not_free_of_noise(weight: float) -> None:
    rows = average_rows(np.arange(5.0)[:, None], np.ones(5), np.full(5, weight))
    assert reach_variance(rows) > 0.0


@given(st.lists(st.integers(-5, 20), min_size=1, max_size=60), st.integers(2, 12))
def test_groups_stay_together_and_folds_are_of_even_size(groups, max_folds) -> None:
    fold_of = {}
    for e, k in zip(groups, group_folds(groups, max_folds), strict=True):
        assert fold_of.setdefault(e, k) == k
    sizes = np.bincount(list(fold_of.values()))
    assert len(sizes) == min(max_folds, len(set(groups)))
    assert sizes.max() - sizes.min() <= 1


def test_without_groups_single_rows_are_spread_over_the_folds() -> None:
    for groups in (None, np.full(100, 7)):
        fold = selection_folds(groups, 100)
        assert np.bincount(fold).tolist() == [20] * 5
        # The order of a grid does not decide the folds.
        assert set(fold[::5]) == set(range(5))
