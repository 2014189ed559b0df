import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.folds import environment_folds, selection_folds


@given(st.lists(st.integers(-5, 20), min_size=1, max_size=60), st.integers(2, 12))
def test_environments_stay_together_and_folds_are_of_even_size(environment, max_folds) -> None:
    distinct = set(environment)
    if len(distinct) < 2:
        with pytest.raises(EstimateError, match="2 or more"):
            environment_folds(environment, max_folds)
        return
    fold = environment_folds(environment, max_folds)
    fold_of = {}
    for e, k in zip(environment, fold, strict=True):
        assert fold_of.setdefault(e, k) == k
    sizes = np.bincount(list(fold_of.values()))
    assert len(sizes) == min(max_folds, len(distinct))
    assert sizes.max() - sizes.min() <= 1


def test_one_fold_is_refused() -> None:
    with pytest.raises(EstimateError, match="got 3 and 1"):
        environment_folds([0, 1, 2], 1)


def test_without_environments_single_rows_are_spread_over_the_folds() -> None:
    for environment in (None, np.full(100, 7)):
        assert np.bincount(selection_folds(environment, 100)).tolist() == [20] * 5
    assert selection_folds(None, 1).tolist() == [0]


def test_environments_of_another_length_than_the_rows_are_refused() -> None:
    with pytest.raises(EstimateError, match=r"each of 3 rows, got \(2,\)"):
        selection_folds([0, 1], 3)


def test_the_order_of_a_grid_does_not_decide_the_folds() -> None:
    assert set(selection_folds(None, 100)[::5]) == set(range(5))
