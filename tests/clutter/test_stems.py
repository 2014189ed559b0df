from dataclasses import replace

import numpy as np
import pytest

from lic_drake.clutter.stems import Stems

PAIR = Stems(
    p_WH=np.zeros((2, 3)),
    R_WS=np.tile(np.eye(3), (2, 1, 1)),
    length=np.ones(2),
    radius=np.full(2, 0.01),
    mass=np.full(2, 0.1),
    stiffness=np.array([4.0, np.inf]),
    damping=np.array([0.1, 0.0]),
    leaf_stem=np.array([1]),
    p_SL=np.zeros((1, 3)),
    R_SL=np.eye(3)[np.newaxis],
    leaf_size=np.full((1, 3), 0.01),
)


def test_a_stem_of_infinite_stiffness_is_fixed() -> None:
    assert PAIR.num_stems == 2
    np.testing.assert_array_equal(PAIR.fixed, [False, True])


def test_moving_stems_moves_their_roots_alone() -> None:
    moved = PAIR.translated(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(moved.p_WH, [[1.0, 2.0, 3.0]] * 2)
    assert moved.p_SL is PAIR.p_SL


def test_arrays_of_wrong_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match=r"length has shape \(3,\), expected \(2,\)"):
        replace(PAIR, length=np.ones(3))
    with pytest.raises(ValueError, match="leaf_stem must be from 0 to 1"):
        replace(PAIR, leaf_stem=np.array([2]))
