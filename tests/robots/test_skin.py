import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RollPitchYaw

from lic_drake.robots.skin import SkinShape

EDGE = st.floats(0.005, 0.5)
ANGLE = st.floats(-3.0, 3.0)


def make_shape(
    kind: str, size: tuple[float, ...], rpy: tuple[float, ...] = (0.0,) * 3
) -> SkinShape:
    return SkinShape(
        link="link",
        kind=kind,
        size=size,
        R_LS=RollPitchYaw(rpy).ToRotationMatrix().matrix(),
        p_LS=np.array([0.1, -0.2, 0.3]),
    )


def distance_to_capsule(shape: SkinShape, p_LQ: np.ndarray) -> np.ndarray:
    """Distances of points from the surface of the enclosing capsule, negative inside."""
    capsule = shape.enclosing_capsule()
    p_CQ = (p_LQ - capsule.p_LS) @ capsule.R_LS
    p_CQ[:, 2] -= np.clip(p_CQ[:, 2], -0.5 * capsule.size[1], 0.5 * capsule.size[1])
    return np.linalg.norm(p_CQ, axis=1) - capsule.size[0]


@given(st.tuples(EDGE, EDGE, EDGE), st.tuples(ANGLE, ANGLE, ANGLE))
def test_the_capsule_of_a_box_touches_its_corners(
    size: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    shape = make_shape("box", size, rpy)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    corners = shape.p_LS + 0.5 * (signs * size) @ shape.R_LS.T
    np.testing.assert_allclose(distance_to_capsule(shape, corners), 0.0, atol=1e-12)


@given(st.tuples(EDGE, EDGE), st.tuples(ANGLE, ANGLE, ANGLE))
def test_the_capsule_of_a_cylinder_touches_its_side_and_rims(
    size: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    shape = make_shape("cylinder", size, rpy)
    radius, length = size
    angle, height = np.meshgrid(np.linspace(0.0, 6.0, 7), [-0.5 * length, 0.0, 0.5 * length])
    p_SQ = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
    p_LQ = shape.p_LS + p_SQ.reshape(-1, 3) @ shape.R_LS.T
    np.testing.assert_allclose(distance_to_capsule(shape, p_LQ), 0.0, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_the_axis_of_a_boxes_capsule_is_its_longest_edge(axis: int) -> None:
    size = tuple(0.3 if i == axis else 0.04 for i in range(3))
    capsule = make_shape("box", size).enclosing_capsule()
    np.testing.assert_allclose(np.abs(capsule.R_LS[:, 2]), np.eye(3)[axis], atol=1e-15)
    np.testing.assert_allclose(capsule.R_LS @ capsule.R_LS.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(capsule.R_LS) == pytest.approx(1.0)
    assert capsule.size[1] == 0.3
    assert capsule.size[0] == pytest.approx(0.02 * np.sqrt(2.0))
