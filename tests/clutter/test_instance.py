from typing import Any

import numpy as np
import pytest

from lic_drake.clutter.instance import ClutterInstance


def arrays(n: int) -> dict[str, Any]:
    return {
        "category": "test",
        "shape": ("box",) * n,
        "size": np.ones((n, 3)),
        "p_WO": np.zeros((n, 3)),
        "yaw": np.zeros(n),
        "mass": np.ones(n),
        "movable": np.zeros(n, dtype=bool),
    }


@pytest.mark.parametrize("n", [0, 1, 5])
def test_the_number_of_objects_is_that_of_the_shapes(n: int) -> None:
    assert ClutterInstance(**arrays(n)).num_objects == n


@pytest.mark.parametrize("name", ["size", "p_WO", "yaw", "mass", "movable"])
def test_arrays_of_another_length_are_refused(name: str) -> None:
    values = arrays(3) | {name: arrays(2)[name]}
    with pytest.raises(ValueError, match=rf"{name} has shape \(2"):
        ClutterInstance(**values)


def test_a_goal_is_a_point_in_space() -> None:
    assert ClutterInstance(**arrays(1)).p_WG is None
    assert ClutterInstance(**arrays(1), p_WG=np.zeros(3)).p_WG is not None
    with pytest.raises(ValueError, match=r"p_WG has shape \(2,\), expected \(3,\)"):
        ClutterInstance(**arrays(1), p_WG=np.zeros(2))


def test_apertures_are_points_in_space() -> None:
    assert ClutterInstance(**arrays(1)).p_WA is None
    assert ClutterInstance(**arrays(1), p_WA=np.zeros((2, 3))).p_WA is not None
    with pytest.raises(ValueError, match=r"p_WA has shape \(3, 2\), expected \(k, 3\)"):
        ClutterInstance(**arrays(1), p_WA=np.zeros((3, 2)))


def test_translation_moves_objects_goal_and_apertures_and_nothing_else() -> None:
    rng, offset = np.random.default_rng(0), np.array([0.5, -2.0, 0.0])
    values = arrays(4) | {"p_WO": rng.uniform(size=(4, 3)), "yaw": rng.uniform(size=4)}
    whole = ClutterInstance(**values, p_WG=rng.uniform(size=3), p_WA=rng.uniform(size=(2, 3)))
    moved = whole.translated(offset)
    for name in ("p_WO", "p_WG", "p_WA"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(whole, name) + offset)
    for name in ("size", "yaw", "mass", "movable"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(whole, name))
    bare = ClutterInstance(**values).translated(offset)
    assert bare.p_WG is None and bare.p_WA is None


def test_only_movable_objects_are_put_elsewhere() -> None:
    values = arrays(4) | {
        "p_WO": np.arange(12.0).reshape(4, 3),
        "movable": np.array([False, True, False, True]),
    }
    whole = ClutterInstance(**values)
    moved = whole.with_objects_at(np.array([[7.0, 8.0], [9.0, 10.0]]))
    np.testing.assert_array_equal(
        moved.p_WO, [[0.0, 1.0, 2.0], [7.0, 8.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]
    )
    np.testing.assert_array_equal(whole.p_WO, np.arange(12.0).reshape(4, 3))


def test_a_shape_that_the_scene_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown shapes \['cone'\]"):
        ClutterInstance(**arrays(2) | {"shape": ("cone", "box")})
