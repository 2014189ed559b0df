from dataclasses import replace

import numpy as np
import pytest

from lic_drake.clutter.instance import Stems, join, make_objects

STEMS = Stems(
    p_WH=np.arange(6.0).reshape(2, 3),
    R_WS=np.tile(np.eye(3), (2, 1, 1)),
    length=np.ones(2),
    radius=np.full(2, 0.01),
    mass=np.full(2, 0.1),
    stiffness=np.array([4.0, np.inf]),
    damping=np.array([0.1, 0.0]),
    leaf_stem=np.array([1, 0, 1]),
    p_SL=np.arange(9.0).reshape(3, 3),
    R_SL=np.tile(np.eye(3), (3, 1, 1)),
    leaf_size=np.full((3, 3), 0.01),
)
MIXED = join(
    make_objects(
        "cylinder", [0.01, 0.2], [[1.0, 2.0], [3.0, 4.0]], mass=0.5, movable=[True, False]
    ),
    make_objects("box", [[1.0, 2.0, 3.0]], [5.0, 6.0, 7.0], yaw=0.3, movable=True, material="wood"),
    p_WG=np.array([0.1, 0.2, 0.0]),
    p_WA=np.ones((2, 3)),
)


def test_objects_of_several_kinds_are_joined_in_order() -> None:
    assert MIXED.shape == ("cylinder", "cylinder", "box")
    np.testing.assert_array_equal(MIXED.size, [[0.01, 0.2, 0.0], [0.01, 0.2, 0.0], [1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(MIXED.p_WO, [[1.0, 2.0, 0.0], [3.0, 4.0, 0.0], [5.0, 6.0, 7.0]])
    np.testing.assert_array_equal(MIXED.yaw, [0.0, 0.0, 0.3])
    np.testing.assert_array_equal(MIXED.mass, [0.5, 0.5, 1.0])
    np.testing.assert_array_equal(MIXED.movable, [True, False, True])
    assert MIXED.material == ("", "", "wood")
    assert join().num_objects == make_objects("box", [1, 1, 1], np.empty((0, 3))).num_objects == 0
    assert (MIXED.num_axes, make_objects("sphere", [0.1], [0.0, 0.0]).num_axes) == (2, 3)


def test_translation_moves_objects_goal_apertures_and_stems() -> None:
    offset = np.array([0.5, -2.0, 0.1])
    whole = replace(MIXED, stems=STEMS)
    moved = whole.translated(offset)
    for name in ("p_WO", "p_WG", "p_WA"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(whole, name) + offset)
    assert moved.stems is not None
    np.testing.assert_array_equal(moved.stems.p_WH, STEMS.p_WH + offset)
    bare = join().translated(offset)
    assert bare.p_WG is bare.p_WA is bare.stems is None


def test_movable_objects_are_put_elsewhere_and_stems_spring_back() -> None:
    moved = MIXED.with_objects_at(np.array([[7.0, 8.0], [9.0, 10.0]]))
    np.testing.assert_array_equal(moved.p_WO, [[7.0, 8.0, 0.0], [3.0, 4.0, 0.0], [9.0, 10.0, 7.0]])
    assert MIXED.p_WO[0, 0] == 1.0
    springy = replace(MIXED, stems=STEMS)
    assert springy.with_objects_at(np.full((2, 2), 0.3)) is springy


def test_a_subset_has_its_objects_in_the_order_asked_for_and_stems_keep_their_leaves() -> None:
    some = MIXED.subset(np.array([2, 0, 0]))
    assert some.shape == ("box", "cylinder", "cylinder")
    np.testing.assert_array_equal(some.p_WO, MIXED.p_WO[[2, 0, 0]])
    stems = STEMS.subset(np.array([False, True]))
    np.testing.assert_array_equal(stems.p_WH, STEMS.p_WH[1:])
    np.testing.assert_array_equal(stems.leaf_stem, [0, 0])
    np.testing.assert_array_equal(stems.p_SL, STEMS.p_SL[[0, 2]])


def test_arrays_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"size has shape .* expected"):
        replace(MIXED, size=np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"unknown shapes \['cone'\]"):
        make_objects("cone", [0.1], [0.0, 0.0])
    with pytest.raises(ValueError, match=r"length has shape \(3,\), expected \(2,\)"):
        replace(STEMS, length=np.ones(3))
    with pytest.raises(ValueError, match="leaf_stem must be from 0 to 1"):
        replace(STEMS, leaf_stem=np.array([2, 0, 0]))
