"""The PR2's closed forms against published numbers alone (`support.pr2_reference`)."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.pr2_reference import link_poses, point_jacobian

from lic_drake.robots.pr2 import pr2_arm
from lic_drake.robots.pr2_kinematics import Pr2Kinematics

# R is the footprint of the base with the torso at 0.
STAND = ((0.0, 0.0, 0.0), 0.0)
ARM = pr2_arm()
assert isinstance(ARM.kinematics, Pr2Kinematics)
KINEMATICS = ARM.kinematics
AHEAD = np.array([1.0, 0.0, 0.0])
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))
INNER_ANGLES = st.tuples(
    *(st.floats(low + 0.01, high - 0.01) for low, high in zip(ARM.q_min, ARM.q_max, strict=True))
)


def tool_of(q: np.ndarray) -> np.ndarray:
    return link_poses(*STAND, q)[7]


def test_the_straight_arm_points_forward_and_reaches_a_metre_from_its_pan_axis() -> None:
    pose = ARM.calc_pose(np.zeros(7))
    np.testing.assert_allclose(pose.p_RE, [0.951, -0.188, 0.051 + 0.739675], atol=1e-12)
    np.testing.assert_allclose(pose.R_RE, np.eye(3), atol=1e-15)
    assert ARM.reach_m == pytest.approx(1.001)
    np.testing.assert_allclose(KINEMATICS.lengths, [0.1, 0.4, 0.321, 0.18], atol=1e-12)
    np.testing.assert_allclose(ARM.p_RS, [-0.05, -0.188, 0.790675], atol=1e-12)


@given(ANGLES, st.lists(st.tuples(st.integers(0, 6), *(st.floats(-0.4, 0.4),) * 3), max_size=5))
def test_poses_and_jacobians_are_those_of_the_published_numbers(
    angles: tuple[float, ...], points: list[tuple[int, float, float, float]]
) -> None:
    q = np.array(angles)
    pose, poses = ARM.calc_pose(q), link_poses(*STAND, q)
    np.testing.assert_allclose(pose.R_RL, poses[:7, :3, :3], atol=1e-12)
    np.testing.assert_allclose(pose.p_RL, poses[:7, :3, 3], atol=1e-12)
    np.testing.assert_allclose(pose.p_RE, poses[7, :3, 3], atol=1e-12)
    J = point_jacobian(*STAND, q, 6, pose.p_RE)
    np.testing.assert_allclose(np.vstack([pose.Jw_E, pose.Jv_E]), J, atol=1e-11)
    for link, *p_LQ in points:
        p_RQ = poses[link, :3, :3] @ p_LQ + poses[link, :3, 3]
        (jacobian,) = ARM.point_jacobians(pose, np.array([link]), p_RQ[None])
        np.testing.assert_allclose(jacobian, point_jacobian(*STAND, q, link, p_RQ)[3:], atol=1e-11)


@given(ANGLES)
def test_every_configuration_of_a_pose_brings_the_tool_there_within_the_limits(
    angles: tuple[float, ...],
) -> None:
    x0 = ARM.tip_pose(np.array(angles))
    assert x0[3] >= 0.0
    solutions = ARM.solve_ik(x0)
    assert np.all((solutions >= ARM.q_min) & (solutions <= ARM.q_max))
    assert np.all(np.abs(solutions[:, [4, 6]]) <= np.pi)
    assert len(np.unique(solutions.round(6), axis=0)) == len(solutions)
    for q in solutions[:: max(1, len(solutions) // 5)]:
        np.testing.assert_allclose(tool_of(q), tool_of(np.array(angles)), atol=1e-7)


@given(INNER_ANGLES)
def test_the_configuration_that_made_a_pose_is_the_nearest_to_it(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    assume(abs(np.cos(q[2])) > 1e-3)  # Where the two rolls meet both lose half their digits.
    x0 = ARM.tip_pose(q)
    (nearest, *others) = ARM.solve_ik(x0 * [1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0], near=q)
    assert np.abs(np.exp(1j * nearest) - np.exp(1j * q)).max() < 1e-7
    assert all(row[0] == q[0] for row in others)


@given(ANGLES)
def test_every_configuration_that_points_does_so_within_the_limits(
    angles: tuple[float, ...],
) -> None:
    X_RE = tool_of(np.array(angles))
    (solutions,) = ARM.solve_pointing(X_RE[None, :3, 3], X_RE[:3, 0])
    assert np.all((solutions >= ARM.q_min) & (solutions <= ARM.q_max))
    np.testing.assert_array_equal(solutions[:, 6], 0.0)
    for q in solutions[:: max(1, len(solutions) // 5)]:
        np.testing.assert_allclose(tool_of(q)[:3, [0, 3]], X_RE[:3, [0, 3]], atol=1e-7)


def test_a_place_before_the_robot_has_many_configurations_and_one_out_of_reach_none() -> None:
    places = np.array([[0.6, -0.3, 0.8], ARM.p_RS + [1.002, 0.0, 0.0], [0.55, -0.1, 0.9]])
    many, none, others = ARM.solve_pointing(places, AHEAD)
    assert len(many) > 50
    assert np.ptp(many[:, 0]) > 0.5
    assert np.ptp([ARM.calc_pose(q).p_RL[3][2] for q in many]) > 0.1
    assert none.shape == (0, 7)
    # Places solved at once have the same bits as one by one.
    np.testing.assert_array_equal(others, ARM.solve_pointing(places[2:], AHEAD)[0])
    # The cheapest one lays the forearm along the way in.
    along = np.array([ARM.calc_pose(q).R_RL[4][0, 0] for q in many])
    assert along[0] == pytest.approx(along.max(), abs=1e-12)


def test_the_straight_arm_is_found_although_its_rolls_are_arbitrary() -> None:
    straight = ARM.p_RS + [1.001, 0.0, 0.0]
    solutions = ARM.solve_ik(np.array([*straight, 1.0, 0.0, 0.0, 0.0]), near=np.zeros(7))
    assert len(solutions) > 0
    for q in solutions:
        np.testing.assert_allclose(ARM.calc_pose(q).p_RE, straight, atol=1e-6)
        np.testing.assert_allclose(ARM.calc_pose(q).R_RE, np.eye(3), atol=1e-6)


@given(ANGLES, st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_the_preselection_cost_is_that_of_equation_5(
    angles: tuple[float, ...], alpha: float, beta: float
) -> None:
    q = np.array(angles)
    X = link_poses(*STAND, q)
    # The elbow is the origin of link 4, the wrist that of link 6.
    wrist, elbow = (abs(AHEAD @ (X[link, :3, 3] - X[7, :3, 3])) for link in (3 + 2, 3))
    if alpha * wrist + beta * elbow > 1e-3:
        (cost,) = KINEMATICS.calc_preselection_cost(q[None], alpha, beta)
        assert cost == pytest.approx(1.0 / (alpha * wrist + beta * elbow), rel=1e-6)
