"""The arm of the 2-D testbed: its numbers, and its inverse kinematics in closed form."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from lic_drake.robots.kinematics import wrap_angle
from lic_drake.robots.planar import PlanarKinematics, planar_arm

ARM = planar_arm()
LENGTHS = np.array([0.196, 0.334, 0.288])
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))
START_X = 0.335
# Feasible starts of the paper's two grids, y -> phi in degrees: 21 and 14 initial conditions.
GRID_30 = {-0.4: [-30, 0], -0.3: [-30, 0, 30], -0.2: [0, 30, 60], -0.1: [30, 60, 90]}
GRID_30 |= {0.0: [30, 60, 90], 0.1: [60, 90], 0.2: [60, 90], 0.3: [60, 90], 0.4: [90]}
GRID_45 = {-0.4: [0], -0.3: [0, 45], -0.2: [0, 45], -0.1: [45, 90], 0.0: [45, 90], 0.1: [45, 90]}
GRID_45 |= {0.2: [90], 0.3: [90], 0.4: [90]}


PLANT, SCENE_GRAPH = MultibodyPlant(time_step=0.0), SceneGraph()
PLANT.RegisterAsSourceForSceneGraph(SCENE_GRAPH)
ARM.add_to_plant(PLANT)
PLANT.Finalize()


def within_limits(q: np.ndarray, tolerance: float = 1e-9) -> bool:
    return bool(np.all(q >= ARM.q_min - tolerance) and np.all(q <= ARM.q_max + tolerance))


def test_limits_gains_and_lengths_are_those_of_the_testbed() -> None:
    np.testing.assert_allclose(np.rad2deg(ARM.q_min), [-150.0, -63.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(np.rad2deg(ARM.q_max), [150.0, 162.0, 159.0], atol=1e-6)
    np.testing.assert_array_equal(ARM.stiffness, [30.0, 20.0, 15.0])
    np.testing.assert_array_equal(ARM.damping, [15.0, 10.0, 8.0])
    assert isinstance(ARM.kinematics, PlanarKinematics)
    np.testing.assert_allclose(ARM.kinematics.link_lengths, LENGTHS, atol=1e-12)
    np.testing.assert_array_equal(ARM.p_RS, 0.0)
    assert ARM.reach_m == pytest.approx(0.818)
    # Contacts between its own links are ignored.
    assert SCENE_GRAPH.model_inspector().GetCollisionCandidates() == set()


@pytest.mark.parametrize(
    ("link", "mass", "com", "inertia"),
    [
        ("link1", 2.835, 0.098, 0.011214),
        ("link2", 2.3, 0.167, 0.024175),
        ("link3", 1.32, 0.1365, 0.009533),
    ],
)
def test_masses_centres_of_mass_and_inertias_are_those_of_the_testbed(
    link: str, mass: float, com: float, inertia: float
) -> None:
    body = PLANT.GetBodyByName(link)
    assert body.default_mass() == pytest.approx(mass)
    np.testing.assert_allclose(body.default_com(), [0.0, -com, 0.0], atol=1e-12)
    about_com = body.default_spatial_inertia().Shift(body.default_com())
    moment = about_com.CalcRotationalInertia().get_moments()[2]
    assert moment == pytest.approx(inertia, rel=1e-6)


@pytest.mark.parametrize(
    ("q_deg", "tip", "phi_deg"),
    [
        ((0, 0, 0), (0.0, -0.818), -90),
        ((-60, 45, 135), (-0.007, -0.277), 30),
        ((-140, 100, 120), (-0.057, -0.156), -10),
        ((-50, 70, 145), (0.039, -0.162), 75),
        ((-100, 110, 110), (0.114, -0.151), 30),
    ],
)
def test_known_postures_have_the_hand_where_the_authors_code_puts_it(
    q_deg: tuple[float, ...], tip: tuple[float, ...], phi_deg: float
) -> None:
    pose = ARM.tip_pose(np.deg2rad(q_deg))
    np.testing.assert_allclose(pose[:2], tip, atol=5e-4)
    assert np.rad2deg(pose[2]) == pytest.approx(phi_deg, abs=1e-9)


@given(ANGLES)
def test_the_preferred_branch_is_the_elbow_bent_forward_where_that_is_legal(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    # Nearer to a straight elbow the root of the cosine is less accurate than the limits' test.
    assume(abs(q[1]) > 1e-3)
    x0 = ARM.tip_pose(q)
    (solution,) = ARM.solve_ik(x0)
    difference = ARM.tip_pose(solution) - x0
    np.testing.assert_allclose([*difference[:2], wrap_angle(difference[2])], 0.0, atol=1e-9)
    if q[1] > 0.0 or solution[1] < 0.0:
        np.testing.assert_allclose(solution, q, atol=1e-6)
    if solution[1] < 0.0:
        # The mirror of link 2 about the line from base to wrist, found without solve_ik.
        a, b = LENGTHS[:2]
        wrist_angle = np.arctan2(b * np.sin(q[1]), a + b * np.cos(q[1]))
        mirrored = np.array(
            [q[0] + 2.0 * wrist_angle, -q[1], q[2] + 2.0 * q[1] - 2.0 * wrist_angle]
        )
        mirrored = np.array([wrap_angle(angle) for angle in mirrored])
        assert not within_limits(mirrored, tolerance=-1e-6)


@given(st.floats(-2.5, 2.5), st.floats(0.1, 2.5))
def test_a_straight_elbow_is_no_reason_to_refuse_a_pose(q1: float, q3: float) -> None:
    x0 = ARM.tip_pose(np.array([q1, 0.0, q3]))
    np.testing.assert_allclose(ARM.tip_pose(ARM.solve_ik(x0)[0])[:2], x0[:2], atol=1e-9)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-np.pi, np.pi - 1e-9))
def test_a_pose_counts_as_infeasible_only_if_no_legal_configuration_reaches_it(
    x: float, y: float, phi: float
) -> None:
    x0 = np.array([x, y, phi])
    if len(ARM.solve_ik(x0)):
        return
    # Every legal elbow angle, densely: the wrist's distance from the base is all it decides.
    wrist = x0[:2] - LENGTHS[2] * np.array([np.cos(phi), np.sin(phi)])
    q2 = np.linspace(ARM.q_min[1], ARM.q_max[1], 20_001)
    elbow = np.stack([LENGTHS[1] * np.sin(q2), -LENGTHS[0] - LENGTHS[1] * np.cos(q2)], axis=1)
    near = np.abs(np.linalg.norm(elbow, axis=1) - np.linalg.norm(wrist)) < 1e-5
    for angle, p in zip(q2[near], elbow[near], strict=True):
        turn = wrap_angle(np.arctan2(wrist[1], wrist[0]) - np.arctan2(p[1], p[0]))
        q = np.array([turn, angle, wrap_angle(phi + 0.5 * np.pi - turn - angle)])
        assert not within_limits(q, tolerance=-1e-3)


@pytest.mark.parametrize(("step_deg", "expected", "count"), [(30, GRID_30, 21), (45, GRID_45, 14)])
def test_the_start_line_has_the_papers_number_of_initial_conditions(
    step_deg: int, expected: dict[float, list[int]], count: int
) -> None:
    feasible = {
        y: [
            phi
            for phi in range(-90, 91, step_deg)
            if len(ARM.solve_ik(np.array([START_X, y, np.deg2rad(phi)])))
        ]
        for y in np.round(np.arange(-0.4, 0.41, 0.1), 1)
    }
    assert feasible == expected
    assert sum(map(len, feasible.values())) == count
