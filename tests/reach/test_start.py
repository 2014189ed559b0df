import numpy as np
import pytest

from lic_drake.errors import RequestError
from lic_drake.reach.start import Start, Starts

X0 = np.array([0.335, 0.1, 0.5])
TOOL = np.array([0.5, 0.1, 1.0, 1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ((np.array([0.335, np.nan, 0.5]),), "x0 of a start must be finite numbers, got"),
        ((X0, np.array([0.0, np.inf, 0.0])), "b0 of a start must be finite numbers, got"),
        ((X0, np.zeros(3), np.array([np.nan])), "q of a start must be finite numbers, got"),
        ((np.zeros(4),), "a start has a hand pose of 3 numbers"),
        ((X0, np.zeros(2)), "a start has a hand pose of 3 numbers"),
    ],
)
def test_what_is_no_start_is_refused(numbers: tuple[np.ndarray, ...], message: str) -> None:
    with pytest.raises(RequestError, match=message):
        Start(*numbers)


def test_starts_of_equal_numbers_are_equal() -> None:
    twins = [Start(X0), Start(X0, np.zeros(3)), Start(X0, np.array([-0.0, 0.0, 0.0]))]
    others = [Start(X0, np.array([0.0, 0.1, 0.0])), Start(X0, q=np.zeros(3)), Start(X0 + 1e-15)]
    assert len({*twins}) == 1
    assert len({*twins, *others}) == 4


def test_r_moves_with_the_base_and_in_space_with_the_torso() -> None:
    b0 = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(Start(X0, b0).x0_R, X0 - [0.1, 0.2, 0.0])
    np.testing.assert_allclose(Start(TOOL, b0).x0_R, TOOL - [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.0])


def test_a_batch_is_taken_and_joined_row_by_row() -> None:
    x0 = np.arange(12.0).reshape(4, 3)
    batch = Starts(x0, 0.1 * x0, 0.2 * x0)
    some = batch.take(np.array([3, 0])).join(batch.take(np.arange(4) == 1))
    assert list(some) == [batch[3], batch[0], batch[1]]
    assert Starts.of(batch[2])[0] == batch[2]
    np.testing.assert_allclose(some.in_R[1], batch[0].x0_R)
    without = some.join(Starts(x0, x0))
    assert len(without) == 7
    assert [start.q is None for start in without] == [False] * 3 + [True] * 4
    assert without.without_q().q is None
