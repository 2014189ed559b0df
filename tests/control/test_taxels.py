import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.control.taxels import CAP_ANGLES_DEG, planar_taxels
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.skin import SkinShape

ARM = planar_arm()
LAYOUT = planar_taxels(ARM.skin)


def capsule(radius: float, length: float, angle: float, p_LC: tuple[float, float]) -> SkinShape:
    """A capsule whose axis lies in the plane at an angle from Lx."""
    axis = np.array([np.cos(angle), np.sin(angle), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    R_LC = np.column_stack([up, np.cross(axis, up), axis])
    return SkinShape(
        link="link",
        kind="capsule",
        size=(radius, length),
        R_LS=R_LC,
        p_LS=np.append(p_LC, 0.0),
    )


@pytest.mark.parametrize(("link", "on_sides"), [(0, 38), (1, 66), (2, 54)])
def test_each_link_has_the_authors_number_of_taxels(link: int, on_sides: int) -> None:
    mine = LAYOUT.link == link
    # A side's normal is at a right angle to the link's axis, which is Ly.
    sides = mine & (np.abs(LAYOUT.n_L[:, 1]) < 1e-12)
    assert np.count_nonzero(sides) == on_sides
    assert np.count_nonzero(mine & ~sides) == 10


def test_the_arm_has_188_taxels_1_cm_apart() -> None:
    assert LAYOUT.num_taxels == 188 == len(LAYOUT.p_LT) == len(LAYOUT.n_L)
    assert LAYOUT.pitch_m == 0.01
    for link in range(3):
        for side in (-1.0, 1.0):
            row = (LAYOUT.link == link) & (np.abs(LAYOUT.n_L[:, 0] - side) < 1e-12)
            y = np.sort(LAYOUT.p_LT[row, 1])
            np.testing.assert_allclose(np.diff(y), 0.01, atol=1e-12)


def test_rows_are_symmetric_about_the_middle_of_a_link_and_alike_on_both_sides() -> None:
    for link, middle in ((0, -0.098), (1, -0.167), (2, -0.1365)):
        p = LAYOUT.p_LT[LAYOUT.link == link]
        for mirror in (p * [-1.0, 1.0, 1.0], [0.0, 2.0 * middle, 0.0] + p * [1.0, -1.0, 1.0]):
            distance = np.linalg.norm(p[:, None] - mirror[None], axis=2)
            assert np.max(np.min(distance, axis=0)) < 1e-12


def test_the_caps_have_taxels_at_0_36_and_72_degrees_from_the_axis() -> None:
    assert CAP_ANGLES_DEG == (-72.0, -36.0, 0.0, 36.0, 72.0)
    last = LAYOUT.link == 2
    tip = last & (LAYOUT.n_L[:, 1] < -1e-12)
    angles = np.rad2deg(np.arctan2(LAYOUT.n_L[tip, 0], -LAYOUT.n_L[tip, 1]))
    np.testing.assert_allclose(np.sort(angles), CAP_ANGLES_DEG, atol=1e-9)
    apex = LAYOUT.p_LT[tip][np.argmin(np.abs(angles))]
    np.testing.assert_allclose(apex, [0.0, -0.288, 0.0], atol=1e-9)


@given(
    st.floats(0.005, 0.05),
    st.floats(0.0, 0.5),
    st.floats(-np.pi, np.pi),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
    st.floats(20.0, 200.0),
)
def test_taxels_of_any_capsule_lie_on_its_surface_with_outward_unit_normals(
    radius: float, length: float, angle: float, p_LC: tuple[float, float], per_metre: float
) -> None:
    skin = capsule(radius, length, angle, p_LC)
    layout = planar_taxels((skin,), per_metre)
    axis = skin.R_LS[:, 2]
    along = np.clip((layout.p_LT - skin.p_LS) @ axis, -0.5 * length, 0.5 * length)
    nearest = skin.p_LS + along[:, None] * axis
    np.testing.assert_allclose(np.linalg.norm(layout.n_L, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(layout.p_LT, nearest + radius * layout.n_L, atol=1e-12)
    np.testing.assert_allclose(layout.p_LT[:, 2], 0.0, atol=1e-12)
    count = layout.num_taxels - 10
    assert count % 2 == 0
    assert abs(0.5 * count - length * per_metre) <= 1.0 + 1e-9


def test_links_keep_the_order_of_the_skin() -> None:
    skin = (capsule(0.01, 0.1, 0.0, (0.0, 0.0)), capsule(0.01, 0.2, 1.0, (0.0, 0.0)))
    layout = planar_taxels(skin, 100.0)
    np.testing.assert_array_equal(layout.link, [0] * 30 + [1] * 50)


@given(st.integers(0, 2), st.tuples(st.floats(-0.05, 0.05), st.floats(-0.4, 0.1)))
def test_the_taxels_of_a_link_rank_by_their_distance_from_a_point(
    link: int, point: tuple[float, float]
) -> None:
    p_LQ = np.append(point, 0.0)
    mine = LAYOUT.of_link[link]
    np.testing.assert_array_equal(mine.taxels, np.flatnonzero(LAYOUT.link == link))
    distance = np.linalg.norm(LAYOUT.p_LT[LAYOUT.link == link] - p_LQ, axis=1)
    compared = mine.compare_distances(p_LQ)
    np.testing.assert_allclose(
        compared - compared.min(), 0.5 * (distance**2 - distance.min() ** 2), atol=1e-15
    )
    both = mine.compare_distances(np.array([np.zeros(3), p_LQ]))
    np.testing.assert_allclose(both[1], compared, atol=1e-15)
