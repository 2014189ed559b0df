import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.pr2_reference import link_poses

from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_inverse import (
    calc_preselection_cost,
    solve_pointing,
    solve_pointing_from_each,
    solve_pose,
)

STAND = ((0.3, -0.2, 0.5), 0.15)
ARM = Pr2Arm(*STAND)
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))

INNER_ANGLES = st.tuples(
    *(st.floats(low + 0.01, high - 0.01) for low, high in zip(ARM.q_min, ARM.q_max, strict=True))
)


def tool_of(q: np.ndarray) -> np.ndarray:
    return link_poses(*STAND, q)[7]


def assert_legal(solutions: np.ndarray) -> None:
    assert np.all(solutions >= ARM.q_min)
    assert np.all(solutions <= ARM.q_max)


@given(ANGLES)
def test_every_configuration_of_a_pose_brings_the_tool_there_within_the_limits(
    angles: tuple[float, ...],
) -> None:
    X_RE = tool_of(np.array(angles))
    solutions = solve_pose(ARM.kinematics, X_RE[:3, 3], X_RE[:3, :3])
    assert_legal(solutions)
    for q in solutions[:: max(1, len(solutions) // 5)]:
        np.testing.assert_allclose(tool_of(q), X_RE, atol=1e-7)


@given(ANGLES)
def test_every_configuration_that_points_does_so_within_the_limits(
    angles: tuple[float, ...],
) -> None:
    X_RE = tool_of(np.array(angles))
    solutions = solve_pointing(ARM.kinematics, X_RE[:3, 3], X_RE[:3, 0])
    assert_legal(solutions)
    np.testing.assert_array_equal(solutions[:, 6], 0.0)
    for q in solutions[:: max(1, len(solutions) // 5)]:
        np.testing.assert_allclose(tool_of(q)[:3, [0, 3]], X_RE[:3, [0, 3]], atol=1e-7)


@given(INNER_ANGLES)
def test_the_configuration_that_made_a_pose_is_among_those_of_its_pan_angle(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    assume(abs(np.cos(q[2])) > 1e-3)  # Where the two rolls meet both lose half their digits.
    X_RE = tool_of(q)
    solutions = solve_pose(ARM.kinematics, X_RE[:3, 3], X_RE[:3, :3], pan=q[:1])
    assert min(np.abs(np.exp(1j * s) - np.exp(1j * q)).max() for s in solutions) < 1e-8


@given(ANGLES)
def test_configurations_differ_and_continuous_joints_are_within_half_a_turn(
    angles: tuple[float, ...],
) -> None:
    X_RE = tool_of(np.array(angles))
    solutions = solve_pose(ARM.kinematics, X_RE[:3, 3], X_RE[:3, :3])
    assert np.all(np.abs(solutions[:, [4, 6]]) <= np.pi)
    assert np.all(np.diff(solutions[:, 0]) >= 0.0)
    assert len(np.unique(solutions.round(6), axis=0)) == len(solutions)


def test_a_pose_before_the_robot_has_many_configurations_of_both_upper_arm_rolls() -> None:
    arm = Pr2Arm()
    solutions = solve_pointing(arm.kinematics, np.array([0.6, -0.3, 0.8]), np.array([1.0, 0, 0]))
    assert len(solutions) > 50
    assert np.ptp(solutions[:, 0]) > 0.5
    down = np.array([arm.link_poses(q)[1][3][2] for q in solutions])
    assert np.ptp(down) > 0.1


def test_a_place_out_of_reach_has_no_configuration() -> None:
    arm = Pr2Arm()
    far = arm.kinematics.p_RA + [1.002, 0.0, 0.0]
    assert solve_pointing(arm.kinematics, far, np.array([1.0, 0.0, 0.0])).shape == (0, 7)
    assert solve_pose(arm.kinematics, far, np.eye(3)).shape == (0, 7)
    assert len(calc_preselection_cost(arm.kinematics, np.zeros((0, 7)))) == 0


def test_the_straight_arm_is_found_although_its_rolls_are_arbitrary() -> None:
    arm = Pr2Arm()
    straight = arm.kinematics.p_RA + [1.001, 0.0, 0.0]
    solutions = solve_pose(arm.kinematics, straight, np.eye(3), pan=np.zeros(1))
    assert len(solutions) > 0
    for q in solutions:
        np.testing.assert_allclose(arm.tip_position(q), straight, atol=1e-6)
        np.testing.assert_allclose(arm.tip_rotation(q), np.eye(3), atol=1e-6)


def test_only_the_given_pan_angles_are_tried() -> None:
    arm = Pr2Arm()
    pan = np.array([-0.8, -0.3])
    solutions = solve_pointing(
        arm.kinematics, np.array([0.6, -0.3, 0.8]), np.array([1.0, 0, 0]), pan
    )
    assert set(solutions[:, 0]) <= {-0.8, -0.3}
    assert len(solutions) > 0


def test_turning_the_base_turns_the_configurations_with_it() -> None:
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    p, u = np.array([0.6, -0.3, 0.8]), np.array([0.8, 0.0, -0.6])
    here = solve_pointing(Pr2Arm().kinematics, p, u)
    there = solve_pointing(
        Pr2Arm((1.0, 2.0, 0.7)).kinematics, R @ p + np.array([1.0, 2.0, 0.0]), R @ u
    )
    np.testing.assert_allclose(here, there, atol=1e-9)


@given(ANGLES, st.floats(0.1, 3.0), st.floats(0.1, 3.0))
def test_the_preselection_cost_is_that_of_equation_5(
    angles: tuple[float, ...], alpha: float, beta: float
) -> None:
    q = np.array(angles)
    X = link_poses(*STAND, q)
    x = np.array([1.0, 0.0, 0.0])
    # The elbow is the origin of link 4, the wrist that of link 6.
    wrist, elbow = (abs(x @ (X[link, :3, 3] - X[7, :3, 3])) for link in (3 + 2, 3))
    if alpha * wrist + beta * elbow > 1e-3:
        (cost,) = calc_preselection_cost(ARM.kinematics, q[None], x, alpha, beta)
        assert cost == pytest.approx(1.0 / (alpha * wrist + beta * elbow), rel=1e-6)


def test_the_cheapest_configuration_lays_the_forearm_along_the_way_in() -> None:
    arm = Pr2Arm()
    q = solve_pointing(arm.kinematics, np.array([0.6, -0.3, 0.8]), np.array([1.0, 0, 0]))
    cost = calc_preselection_cost(arm.kinematics, q)
    along = np.array([arm.link_poses(row)[0][4][0, 0] for row in q])
    assert along[np.argmin(cost)] == pytest.approx(along.max(), abs=1e-12)
    # The wrist lies 0.18 m behind the tool, the elbow at most a forearm behind the wrist.
    assert cost.min() >= 1.0 / (0.18 + (0.18 + 0.321))


def test_places_solved_at_once_have_the_same_bits_as_one_by_one() -> None:
    ahead = np.array([1.0, 0.0, 0.0])
    p_RE = np.array([[0.6, -0.3, 0.8], [9.0, 0.0, 0.0], [0.55, -0.1, 0.9], [0.5, -0.6, 1.0]])
    for p, q in zip(p_RE, solve_pointing_from_each(ARM.kinematics, p_RE, ahead), strict=True):
        np.testing.assert_array_equal(q, solve_pointing(ARM.kinematics, p, ahead))
