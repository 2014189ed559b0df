import numpy as np
import pytest

from lic_drake.errors import LicError
from lic_drake.estimate.checks import checked_queries, checked_rows, feature_scale


@pytest.mark.parametrize(
    ("Z", "f", "message"),
    [
        (np.zeros((0, 4)), np.zeros(0), r"no training rows.*\(0, 4\).*collect"),
        (np.zeros((2, 4)), np.zeros(3), r"\(2, 4\) and \(3,\)"),
        (np.zeros(4), np.zeros(4), r"Z \(n, d\)"),
        ([[0.0, 1.0], [np.nan, 0.0]], [0, 1], r"1 of 2 .*NaN or infinite.* row 1"),
        ([[0.0, np.inf]], [1], r"NaN or infinite"),
        ([[0.0], [1.0]], [0, 0.5], r"0 or 1, got 0.5 in row 1"),
        ([[0.0], [1.0]], [0, np.nan], r"0 or 1, got nan in row 1"),
    ],
)
def test_unusable_training_rows_are_refused_with_what_is_wrong(Z, f, message) -> None:
    with pytest.raises(LicError, match=message):
        checked_rows(Z, f)


def test_booleans_become_numbers_and_minus_zero_becomes_zero() -> None:
    Z, f = checked_rows([[-0.0, 1.0]], [True])
    assert f.tolist() == [1.0]
    assert not np.signbit(Z).any()


@pytest.mark.parametrize("Z", [np.zeros((1, 3)), np.zeros(4), [[0.0, 0.0, 0.0, np.nan]]])
def test_unusable_queries_are_refused(Z) -> None:
    with pytest.raises(LicError, match="queries"):
        checked_queries(Z, 4)


def test_a_constant_feature_has_scale_one() -> None:
    Z = np.column_stack([np.full(7, 0.335), np.arange(7.0)])
    assert feature_scale(Z).tolist() == [1.0, 2.0]
