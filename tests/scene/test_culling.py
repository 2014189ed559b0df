from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from worlds import box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.scene.culling import (
    KEEP_MARGIN_M,
    SLACK_M,
    outer_radius,
    reaches_left_out,
    select_near,
    take,
)

REACH = 0.818
COORDINATE = st.floats(-2.0, 2.0)
SIZE = st.floats(1e-3, 0.5)


@st.composite
def clutters(draw: st.DrawFn, max_size: int = 12) -> ClutterInstance:
    objects = []
    for _ in range(draw(st.integers(0, max_size))):
        x, y, movable = draw(COORDINATE), draw(COORDINATE), draw(st.booleans())
        if draw(st.booleans()):
            objects.append(cylinder(x, y, movable=movable, radius=draw(SIZE)))
        else:
            edges = (draw(SIZE), draw(SIZE), 0.2)
            objects.append(box(x, y, edges, draw(st.floats(-4.0, 4.0)), movable))
    return make_clutter(*objects)


def outline(instance: ClutterInstance, i: int) -> np.ndarray:
    """Points on the outline of an object in the plane, shape (n, 2)."""
    if instance.shape[i] == "cylinder":
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        local = instance.size[i, 0] * np.column_stack([np.cos(angle), np.sin(angle)])
    else:
        half = 0.5 * instance.size[i, :2]
        corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])
        s = np.linspace(0.0, 1.0, 20)[:, None]
        local = np.vstack([a + s * (b - a) for a, b in pairwise(corners)])
    c, s = np.cos(instance.yaw[i]), np.sin(instance.yaw[i])
    return instance.p_WO[i, :2] + local @ np.array([[c, s], [-s, c]])


@given(clutters())
def test_an_enclosing_circle_holds_the_whole_outline_and_touches_it(
    instance: ClutterInstance,
) -> None:
    radii = outer_radius(instance)
    for i in range(instance.num_objects):
        farthest = np.linalg.norm(outline(instance, i) - instance.p_WO[i, :2], axis=1).max()
        assert farthest == pytest.approx(radii[i], rel=1e-9)


@given(clutters())
def test_whatever_the_arm_can_touch_is_kept(instance: ClutterInstance) -> None:
    keep = select_near(instance, REACH)
    for i in np.flatnonzero(~keep):
        nearest = np.linalg.norm(outline(instance, i), axis=1).min()
        # The skin of a stretched arm ends at its reach.
        assert nearest > REACH + KEEP_MARGIN_M - 1e-9


@given(clutters())
def test_objects_that_nothing_can_touch_are_left_out(instance: ClutterInstance) -> None:
    keep = select_near(instance, REACH)
    distance = np.linalg.norm(instance.p_WO[:, :2], axis=1)
    np.testing.assert_array_equal(keep, distance <= REACH + KEEP_MARGIN_M + outer_radius(instance))


@given(clutters(), st.data())
def test_taking_keeps_order_and_every_property(
    instance: ClutterInstance, data: st.DataObject
) -> None:
    n = instance.num_objects
    keep = np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n)), dtype=bool)
    part, rest = take(instance, keep), take(instance, ~keep)
    assert part.category == instance.category
    assert part.num_objects + rest.num_objects == n
    for j, i in enumerate(np.flatnonzero(keep)):
        assert part.shape[j] == instance.shape[i]
        for name in ("size", "p_WO", "yaw", "mass", "movable"):
            np.testing.assert_array_equal(getattr(part, name)[j], getattr(instance, name)[i])


@given(clutters(), COORDINATE.map(abs))
def test_a_left_out_object_can_be_missed_only_if_no_moved_one_came_near(
    instance: ClutterInstance, outermost: float
) -> None:
    keep = select_near(instance, REACH)
    if reaches_left_out(instance, keep, outermost):
        return
    # The worst case: each kept movable object stands at that distance, in the very direction of
    # each object that was left out, and has still the slack to go.
    radii = outer_radius(instance)
    for i in np.flatnonzero(keep & instance.movable):
        for j in np.flatnonzero(~keep):
            if outermost > 0.0:
                distance = np.linalg.norm(instance.p_WO[j, :2])
                assert distance - outermost > radii[i] + radii[j] + SLACK_M - 1e-9


def test_nothing_can_be_missed_if_nothing_was_left_out_or_nothing_moved() -> None:
    near, far = cylinder(0.6, 0.0, movable=True), cylinder(0.95, 0.0, movable=True)
    both = make_clutter(near, far)
    keep = select_near(both, REACH)
    np.testing.assert_array_equal(keep, [True, False])
    assert not reaches_left_out(both, keep, 0.0)
    assert not reaches_left_out(both, np.array([True, True]), 5.0)


def test_an_object_pushed_up_to_a_left_out_one_is_noticed() -> None:
    near, far = cylinder(0.6, 0.0, movable=True), cylinder(0.95, 0.0)
    both = make_clutter(near, far)
    keep = select_near(both, REACH)
    # Contact at 0.93 m; with the slack of one control period from 0.91 m on.
    assert not reaches_left_out(both, keep, 0.909)
    assert reaches_left_out(both, keep, 0.911)


def test_a_fixed_wall_whose_corner_comes_near_is_kept_although_its_centre_is_far() -> None:
    wall = make_clutter(box(1.15, 0.0, (0.5, 0.3, 0.2), yaw=0.3))
    np.testing.assert_array_equal(select_near(wall, REACH), [True])
    round_one = make_clutter(cylinder(1.15, 0.0, radius=0.15))
    np.testing.assert_array_equal(select_near(round_one, REACH), [False])
