import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.pr2_reference import link_poses, point_jacobian

from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_kinematics import calc_point_jacobians

ARM = Pr2Arm()
ANGLES = st.tuples(*(st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True)))
STANDS = st.tuples(
    st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-4.0, 4.0)),
    st.floats(0.0115, 0.305),
)
Stand = tuple[tuple[float, float, float], float]


@given(STANDS, ANGLES)
def test_links_and_tool_are_where_the_published_numbers_put_them(
    stand: Stand, angles: tuple[float, ...]
) -> None:
    pose = Pr2Arm(*stand).kinematics.calc_pose(*angles)
    expected = link_poses(*stand, np.array(angles))
    np.testing.assert_allclose(pose.R_RL, expected[:7, :3, :3], atol=1e-12)
    np.testing.assert_allclose(pose.p_RL, expected[:7, :3, 3], atol=1e-12)
    np.testing.assert_allclose(pose.p_RE, expected[7, :3, 3], atol=1e-12)


@given(STANDS, ANGLES)
def test_the_tools_jacobians_are_those_of_the_published_numbers(
    stand: Stand, angles: tuple[float, ...]
) -> None:
    pose = Pr2Arm(*stand).kinematics.calc_pose(*angles)
    p_RE = link_poses(*stand, np.array(angles))[7, :3, 3]
    expected = point_jacobian(*stand, np.array(angles), 6, p_RE)
    np.testing.assert_allclose(pose.Jw_E, expected[:3], atol=1e-12)
    np.testing.assert_allclose(pose.Jv_E, expected[3:], atol=1e-11)


@given(
    STANDS,
    ANGLES,
    st.lists(st.tuples(st.integers(0, 6), *(st.floats(-0.4, 0.4),) * 3), max_size=5),
)
def test_point_jacobians_are_those_of_the_published_numbers(
    stand: Stand, angles: tuple[float, ...], points: list[tuple[int, float, float, float]]
) -> None:
    q = np.array(angles)
    links = np.array([link for link, *_ in points], dtype=np.intp)
    poses = link_poses(*stand, q)
    p_RQ = np.array(
        [poses[link, :3, :3] @ p_LQ + poses[link, :3, 3] for link, *p_LQ in points]
    ).reshape(-1, 3)
    jacobians = calc_point_jacobians(Pr2Arm(*stand).kinematics.calc_pose(*angles), links, p_RQ)
    assert jacobians.shape == (len(points), 3, 7)
    for jacobian, link, p in zip(jacobians, links, p_RQ, strict=True):
        expected = point_jacobian(*stand, q, link, p)[3:]
        np.testing.assert_allclose(jacobian, expected, atol=1e-11)


@given(ANGLES)
def test_the_tools_jacobian_is_the_derivative_of_its_place(angles: tuple[float, ...]) -> None:
    q, step = np.array(angles), 1e-6
    numeric = np.transpose(
        [
            (ARM.tip_position(q + delta) - ARM.tip_position(q - delta)) / (2.0 * step)
            for delta in step * np.eye(7)
        ]
    )
    np.testing.assert_allclose(ARM.tip_jacobian(q), numeric, atol=1e-8)


@given(ANGLES, st.sampled_from([4, 6]), st.sampled_from([-2.0, 2.0]))
def test_a_whole_turn_of_a_continuous_joint_changes_nothing(
    angles: tuple[float, ...], joint: int, half_turns: float
) -> None:
    q = np.array(angles)
    turned = q.copy()
    turned[joint] += half_turns * np.pi
    before, after = ARM.kinematics.calc_pose(*q), ARM.kinematics.calc_pose(*turned)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


@pytest.mark.parametrize("joint", [4, 6])
def test_nothing_jumps_where_a_continuous_joint_passes_half_a_turn(joint: int) -> None:
    below, above = ARM.q_home.copy(), ARM.q_home.copy()
    below[joint], above[joint] = np.pi - 1e-7, -np.pi + 1e-7
    for one, other in zip(ARM.link_poses(below), ARM.link_poses(above), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6)
    np.testing.assert_allclose(ARM.tip_jacobian(below), ARM.tip_jacobian(above), atol=1e-6)


def test_the_straight_arm_points_forward_and_reaches_a_metre_from_its_pan_axis() -> None:
    arm = Pr2Arm(torso_m=0.3)
    np.testing.assert_allclose(
        arm.tip_position(np.zeros(7)), [0.951, -0.188, 0.051 + 0.739675 + 0.3], atol=1e-12
    )
    np.testing.assert_allclose(arm.tip_rotation(np.zeros(7)), np.eye(3), atol=1e-15)
    assert sum(arm.kinematics.lengths) == pytest.approx(1.001)


@given(ANGLES)
def test_no_tool_is_further_away_than_the_reach(angles: tuple[float, ...]) -> None:
    assert np.linalg.norm(ARM.tip_position(np.array(angles)) - ARM.p_RS) <= ARM.reach_m + 1e-12


@given(ANGLES, ANGLES)
def test_answers_do_not_depend_on_what_was_asked_before(
    angles: tuple[float, ...], others: tuple[float, ...]
) -> None:
    q, other = np.array(angles), np.array(others)
    questions = (ARM.tip_position, ARM.tip_jacobian, lambda q: ARM.link_poses(q)[0])
    first = [np.array(question(q)) for question in questions]
    for question, answer in zip(questions, first, strict=True):
        question(other)
        np.testing.assert_array_equal(question(q), answer)


def test_shared_answers_cannot_be_written_to() -> None:
    for answer in ARM.kinematics.calc_pose(*ARM.q_home):
        with pytest.raises(ValueError, match="read-only"):
            answer[0] = 1.0
