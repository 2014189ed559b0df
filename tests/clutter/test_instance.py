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


def test_a_shape_that_the_scene_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown shapes \['cone'\]"):
        ClutterInstance(**arrays(2) | {"shape": ("cone", "box")})
