import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lic_drake.robots.planar_kinematics import PlanarArmKinematics, wrap_angle

# The arm of the testbed, written down here and not read from its description.
ARM = PlanarArmKinematics(
    link_lengths=np.array([0.196, 0.334, 0.288]),
    q_min=np.deg2rad([-150.0, -63.0, 0.0]),
    q_max=np.deg2rad([150.0, 162.0, 159.0]),
)

Q1, Q2, Q3 = (st.floats(low, high) for low, high in zip(ARM.q_min, ARM.q_max, strict=True))
ANGLES = st.tuples(Q1, Q2, Q3)
FORWARD = st.tuples(Q1, st.floats(1e-3, ARM.q_max[1]), Q3)
BACKWARD = st.tuples(Q1, st.floats(ARM.q_min[1], -1e-3), Q3)
START_X = 0.335
# Feasible starts of the paper's two grids, y -> phi in degrees: 21 and 14 initial conditions.
GRID_30 = {
    -0.4: [-30, 0],
    -0.3: [-30, 0, 30],
    -0.2: [0, 30, 60],
    -0.1: [30, 60, 90],
    0.0: [30, 60, 90],
    0.1: [60, 90],
    0.2: [60, 90],
    0.3: [60, 90],
    0.4: [90],
}
GRID_45 = {
    -0.4: [0],
    -0.3: [0, 45],
    -0.2: [0, 45],
    -0.1: [45, 90],
    0.0: [45, 90],
    0.1: [45, 90],
    0.2: [90],
    0.3: [90],
    0.4: [90],
}


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


@given(st.floats(-100.0, 100.0))
def test_a_wrapped_angle_is_the_same_direction_in_the_half_open_interval(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angle), atol=1e-12)


def test_half_a_turn_wraps_to_minus_pi_from_either_side() -> None:
    assert wrap_angle(np.pi) == -np.pi
    assert wrap_angle(-np.pi) == -np.pi


@given(ANGLES)
def test_ik_puts_the_hand_where_fk_said_it_was(angles: tuple[float, ...]) -> None:
    q = np.array(angles)
    # Nearer to a straight elbow the root of the cosine is less accurate than the limits' test.
    assume(abs(q[1]) > 1e-6)
    x0 = ARM.tip_pose(q)
    solution = ARM.solve_ik(x0)
    assert solution is not None
    assert ARM.within_limits(solution)
    difference = ARM.tip_pose(solution) - x0
    difference[2] = wrap_angle(difference[2])
    np.testing.assert_allclose(difference, 0.0, atol=1e-9)


@given(st.floats(-2.5, 2.5), st.floats(0.1, 2.5))
def test_a_straight_elbow_is_no_reason_to_refuse_a_pose(q1: float, q3: float) -> None:
    x0 = ARM.tip_pose(np.array([q1, 0.0, q3]))
    solution = ARM.solve_ik(x0)
    assert solution is not None
    np.testing.assert_allclose(ARM.tip_pose(solution)[:2], x0[:2], atol=1e-9)


@given(FORWARD)
def test_ik_returns_the_very_configuration_where_the_elbow_is_bent_forward(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    solution = ARM.solve_ik(ARM.tip_pose(q))
    assert solution is not None
    np.testing.assert_allclose(solution, q, atol=1e-6)


@given(BACKWARD)
def test_ik_takes_the_other_branch_only_where_the_preferred_one_breaks_a_limit(
    angles: tuple[float, ...],
) -> None:
    q = np.array(angles)
    solution = ARM.solve_ik(ARM.tip_pose(q))
    assert solution is not None
    if solution[1] < 0.0:
        np.testing.assert_allclose(solution, q, atol=1e-6)
        # The mirror of link 2 about the line from base to wrist, found without solve_ik.
        a, b = ARM.link_lengths[:2]
        wrist_angle = np.arctan2(b * np.sin(q[1]), a + b * np.cos(q[1]))
        mirrored = np.array(
            [q[0] + 2.0 * wrist_angle, -q[1], q[2] + 2.0 * q[1] - 2.0 * wrist_angle]
        )
        np.testing.assert_allclose(
            ARM.link_origins(mirrored)[2:], ARM.link_origins(q)[2:], atol=1e-9
        )
        mirrored = np.array([wrap_angle(angle) for angle in mirrored])
        assert not ARM.within_limits(mirrored, tolerance=-1e-6)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-np.pi, np.pi - 1e-9))
def test_a_pose_counts_as_infeasible_only_if_no_legal_configuration_reaches_it(
    x: float, y: float, phi: float
) -> None:
    x0 = np.array([x, y, phi])
    solution = ARM.solve_ik(x0)
    if solution is not None:
        pose = ARM.tip_pose(solution)
        np.testing.assert_allclose(pose[:2], x0[:2], atol=1e-7)
        assert abs(wrap_angle(pose[2] - phi)) < 1e-7
        return
    # Every legal elbow angle, densely: the wrist's distance from the base is all it decides.
    wrist = x0[:2] - ARM.link_lengths[2] * np.array([np.cos(phi), np.sin(phi)])
    q2 = np.linspace(ARM.q_min[1], ARM.q_max[1], 20_001)
    origin = np.array([ARM.link_origins(np.array([0.0, angle, 0.0]))[2] for angle in q2[::100]])
    lengths = np.interp(q2, q2[::100], np.linalg.norm(origin, axis=1))
    near = np.abs(lengths - np.linalg.norm(wrist)) < 1e-5
    for angle in q2[near]:
        elbow = ARM.link_origins(np.array([0.0, angle, 0.0]))[2]
        turn = wrap_angle(np.arctan2(wrist[1], wrist[0]) - np.arctan2(elbow[1], elbow[0]))
        q = np.array([turn, angle, wrap_angle(phi + 0.5 * np.pi - turn - angle)])
        assert not ARM.within_limits(q, tolerance=-1e-3)


def test_a_pose_beyond_the_reach_has_no_configuration() -> None:
    assert ARM.reach_m == pytest.approx(0.818)
    assert ARM.solve_ik(np.array([0.0, -0.8179, -0.5 * np.pi])) is not None
    assert ARM.solve_ik(np.array([0.0, -0.8181, -0.5 * np.pi])) is None


@given(ANGLES)
def test_the_tip_jacobian_is_the_derivative_of_the_tip_pose(angles: tuple[float, ...]) -> None:
    q, step = np.array(angles), 1e-6
    columns = []
    for joint in range(3):
        delta = step * np.eye(3)[joint]
        change = ARM.tip_pose(q + delta) - ARM.tip_pose(q - delta)
        change[2] = wrap_angle(change[2])
        columns.append(change / (2.0 * step))
    np.testing.assert_allclose(ARM.tip_pose_jacobian(q), np.transpose(columns), atol=1e-8)


@given(ANGLES, st.integers(0, 2), st.floats(0.0, 1.0), st.floats(-0.05, 0.05))
def test_a_point_jacobian_is_the_derivative_of_the_point_on_its_link(
    angles: tuple[float, ...], link: int, along: float, aside: float
) -> None:
    def place(q: np.ndarray) -> np.ndarray:
        start, end = ARM.link_origins(q)[link : link + 2]
        axis = (end - start) / ARM.link_lengths[link]
        return start + along * (end - start) + aside * np.array([-axis[1], axis[0]])

    q, step = np.array(angles), 1e-6
    numeric = np.transpose([(place(q + d) - place(q - d)) / (2.0 * step) for d in step * np.eye(3)])
    np.testing.assert_allclose(ARM.point_jacobian(q, link, place(q)), numeric, atol=1e-8)


@pytest.mark.parametrize(("step_deg", "expected", "count"), [(30, GRID_30, 21), (45, GRID_45, 14)])
def test_the_start_line_has_the_papers_number_of_initial_conditions(
    step_deg: int, expected: dict[float, list[int]], count: int
) -> None:
    feasible = {
        y: [
            phi
            for phi in range(-90, 91, step_deg)
            if ARM.solve_ik(np.array([START_X, y, np.deg2rad(phi)])) is not None
        ]
        for y in np.round(np.arange(-0.4, 0.41, 0.1), 1)
    }
    assert feasible == expected
    assert sum(len(phis) for phis in feasible.values()) == count


@pytest.mark.parametrize(
    ("y", "low", "high"),
    [
        (-0.4, -33.0, 25.5),
        (-0.3, -31.5, 47.0),
        (-0.2, -9.5, 70.5),
        (-0.1, 10.5, 90.0),
        (0.0, 28.5, 90.0),
        (0.1, 43.5, 90.0),
        (0.2, 52.0, 90.0),
        (0.3, 52.0, 90.0),
        (0.4, 67.5, 90.0),
    ],
)
def test_feasible_orientations_are_one_interval_at_each_position(
    y: float, low: float, high: float
) -> None:
    phi = np.arange(-90.0, 90.25, 0.25)
    legal = [ARM.solve_ik(np.array([START_X, y, np.deg2rad(p)])) is not None for p in phi]
    inside = phi[legal]
    assert np.count_nonzero(np.diff(legal)) == (1 if high == 90.0 else 2)
    np.testing.assert_allclose([inside[0], inside[-1]], [low, high], atol=0.5)


@pytest.mark.parametrize(("y", "phi_deg"), [(-0.2, 60.0), (-0.1, 90.0)])
def test_the_elbow_is_bent_forward_where_both_branches_are_legal(y: float, phi_deg: float) -> None:
    q = ARM.solve_ik(np.array([START_X, y, np.deg2rad(phi_deg)]))
    assert q is not None
    assert q[1] > 0.0
