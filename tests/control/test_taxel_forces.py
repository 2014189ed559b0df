import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.control.tactile_sensor import ContactPatch, calc_taxel_forces
from lic_drake.control.taxels import planar_taxels
from lic_drake.robots.planar import planar_arm

ARM = planar_arm()
LAYOUT = planar_taxels(ARM.skin, ARM.link_names)
POSES = ARM.calc_pose(np.deg2rad([-30.0, 60.0, 50.0]))[:2]
ANGLE = st.floats(-np.pi, np.pi)
LINK = st.integers(0, 2)


def press(link: int, p_L: np.ndarray, f_L: np.ndarray) -> np.ndarray:
    """Taxel forces of one patch whose faces and forces on the object are given in its link."""
    R_RL, p_RL = (part[link] for part in POSES)
    force = np.linalg.norm(f_L, axis=1)
    n_R = f_L @ R_RL.T / np.where(force > 0.0, force, 1.0)[:, None]
    patch = ContactPatch(link=link, p_RQ=p_RL + p_L @ R_RL.T, n_R=n_R, force=force)
    return calc_taxel_forces(LAYOUT, *POSES, [patch])


POINT = st.tuples(st.floats(-0.02, 0.02), st.floats(-0.35, 0.02), st.floats(-0.02, 0.02))


@given(LINK, POINT, ANGLE, st.floats(1e-3, 100.0))
def test_a_point_contact_loads_one_taxel_of_its_link_with_its_whole_force(
    link: int, point: tuple[float, float, float], angle: float, force: float
) -> None:
    direction = np.array([[np.cos(angle), np.sin(angle), 0.0]])
    forces = press(link, np.array([point]), force * direction)
    (loaded,) = np.flatnonzero(forces)
    assert LAYOUT.link[loaded] == link
    assert forces[loaded] == pytest.approx(force)
    # The rule in plain words: no taxel within 45 degrees of the force is nearer.
    mine = np.flatnonzero(LAYOUT.link == link)
    distance = np.linalg.norm(LAYOUT.p_LT[mine] - point, axis=1)
    facing = np.rad2deg(np.arccos(np.clip(LAYOUT.n_L[mine] @ direction[0], -1.0, 1.0)))
    own = np.flatnonzero(mine == loaded)[0]
    assert facing[own] < 45.0 + 1e-6
    assert distance[own] <= distance[facing < 45.0 - 1e-6].min() + 1e-12


def test_a_force_that_no_taxel_faces_is_not_lost() -> None:
    forces = press(1, np.array([[0.0, -0.1, 0.015]]), np.array([[0.0, 0.0, 2.0]]))
    assert forces.sum() == pytest.approx(2.0)
    (loaded,) = np.flatnonzero(forces)
    assert LAYOUT.p_LT[loaded, 1] == pytest.approx(-0.1, abs=0.005)


FACES = st.lists(
    st.tuples(st.floats(-0.004, 0.004), st.floats(-0.4, 0.4), st.floats(1e-3, 5.0)),
    min_size=1,
    max_size=8,
)


@given(st.floats(-0.25, -0.02), st.sampled_from([-1.0, 1.0]), FACES)
def test_a_narrow_patch_reads_its_resultant_at_its_centre_of_pressure(
    along: float, side: float, faces: list[tuple[float, float, float]]
) -> None:
    offset, tilt, force = np.array(faces).T
    p_L = np.column_stack([np.full(len(faces), side * 0.015), along + offset, 0.0 * offset])
    f_L = force[:, None] * np.column_stack([side * np.cos(tilt), np.sin(tilt), 0.0 * tilt])
    forces = press(2, p_L, f_L)
    total = f_L.sum(axis=0)
    assert forces.sum() == pytest.approx(np.linalg.norm(total))
    (loaded,) = np.flatnonzero(forces)
    centre = along + offset @ force / force.sum()
    assert LAYOUT.n_L[loaded, 0] == side
    assert abs(LAYOUT.p_LT[loaded, 1] - centre) <= 0.005 + 1e-9


def test_a_wide_patch_spreads_over_the_taxels_under_it() -> None:
    y = np.linspace(-0.20, -0.10, 201)
    p_L = np.column_stack([np.full(201, 0.015), y, np.zeros(201)])
    forces = press(2, p_L, np.tile([10.0 / 201.0, 0.0, 0.0], (201, 1)))
    loaded = np.flatnonzero(forces)
    assert forces.sum() == pytest.approx(10.0)
    np.testing.assert_array_equal(LAYOUT.n_L[loaded, 0], 1.0)
    # The pressure is even: a taxel in the middle takes 1 cm of 10 cm.
    inner = forces[loaded][np.abs(LAYOUT.p_LT[loaded, 1] + 0.15) < 0.04]
    np.testing.assert_allclose(inner, 1.0, rtol=0.06)
    assert len(loaded) in (10, 11)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("force", [0.0, 2.0])
def test_faces_whose_forces_cancel_read_nothing(force: float) -> None:
    f_L = np.array([[force, 0.0, 0.0], [-force, 0.0, 0.0]])
    forces = press(2, np.array([[0.015, -0.1, 0.0]] * 2), f_L)
    np.testing.assert_allclose(forces, 0.0, atol=1e-12)
