import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.kinematics import link_origins, only
from support.starts import APERTURES, ARM, LINE, hand_pose_by_drake

from lic_drake.reach.hand_poses import HandPoses

POSES = [LINE.poses, APERTURES.poses]
BOTH = pytest.mark.parametrize("poses", POSES, ids=["line", "apertures"])


def test_the_papers_line_has_21_poses() -> None:
    assert len(LINE.poses.grid) == 21


@BOTH
def test_every_pose_of_grid_and_lattice_is_one_that_the_arm_can_take(poses: HandPoses) -> None:
    for x0 in np.vstack([poses.grid, poses.lattice]):
        q = only(ARM.solve_ik(x0))
        assert q is not None
        np.testing.assert_allclose(hand_pose_by_drake(q, np.zeros(2)), x0, atol=1e-9)
        assert np.all(q >= ARM.q_min - 1e-9)
        assert np.all(q <= ARM.q_max + 1e-9)
        assert np.all(x0 >= poses.line.lower - 1e-9)
        assert np.all(x0 <= poses.line.upper + 1e-9)
        assert poses.contains(x0)


@BOTH
def test_the_lattice_lacks_nothing_that_is_possible(poses: HandPoses) -> None:
    line = poses.line
    y = np.linspace(line.y_min_m, line.y_max_m, 33)
    phi = np.linspace(*np.deg2rad([line.phi_min_deg, line.phi_max_deg]), 25)
    possible = {
        (round(yi, 9), round(phi_i, 9))
        for yi in y
        for phi_i in phi
        if only(ARM.solve_ik(np.array([line.x_m, yi, phi_i]))) is not None
    }
    assert {(round(yi, 9), round(p, 9)) for _, yi, p in poses.lattice} == possible


def test_the_whole_arm_is_behind_the_start_line_at_every_pose() -> None:
    for poses in POSES:
        for x0 in poses.lattice:
            q = only(ARM.solve_ik(x0))
            assert q is not None
            assert link_origins(ARM, q)[:, 0].max() <= x0[0] + 1e-9


def test_poses_off_the_line_or_beyond_the_joint_limits_are_not_contained() -> None:
    poses = LINE.poses
    assert not poses.contains(np.array([0.4, 0.0, 1.0]))
    assert not poses.contains(np.array([0.335, 0.5, 1.0]))
    assert not poses.contains(np.array([0.335, 0.3, 0.0]))


@settings(max_examples=200)
@given(st.sampled_from(POSES), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_between_the_ends_of_orientations_all_is_possible_and_beyond_them_soon_nothing(
    poses: HandPoses, where: float, share: float
) -> None:
    low_y, high_y = poses.y_range
    y = low_y + where * (high_y - low_y)
    (low, high), _ = poses.phi_range(y)
    x_m, bounds = poses.line.x_m, np.deg2rad([poses.line.phi_min_deg, poses.line.phi_max_deg])
    if high >= low:
        assert poses.contains(np.array([x_m, y, low + share * (high - low)]))
    # 5 mm of the line are 2 degrees at the most; between them the ends are interpolated.
    for end, bound, sign in ((low, bounds[0], -1.0), (high, bounds[1], 1.0)):
        beyond = end + sign * 0.01
        at_the_bound = abs(end - bound) < 0.01
        assert at_the_bound or only(ARM.solve_ik(np.array([x_m, y, beyond]))) is None


@pytest.mark.parametrize("poses", POSES, ids=["line", "apertures"])
def test_the_ends_of_orientations_have_the_slopes_of_differences(poses: HandPoses) -> None:
    low_y, high_y = poses.y_range
    step = 1e-6
    for y in np.linspace(low_y, high_y, 200)[1:-1] + 1.7e-5:
        _, slopes = poses.phi_range(y)
        ahead, behind = poses.phi_range(y + step)[0], poses.phi_range(y - step)[0]
        np.testing.assert_allclose(slopes, (ahead - behind) / (2 * step), atol=1e-6)


@pytest.mark.parametrize("poses", POSES, ids=["line", "apertures"])
def test_outside_the_range_of_positions_the_arm_can_take_nothing_but_at_its_edge(
    poses: HandPoses,
) -> None:
    low_y, high_y = poses.y_range
    line = poses.line
    phi = np.linspace(*np.deg2rad([line.phi_min_deg, line.phi_max_deg]), 361)
    for y in np.linspace(line.y_min_m, line.y_max_m, 161):
        if low_y - 0.005 <= y <= high_y + 0.005:
            continue
        assert all(only(ARM.solve_ik(np.array([line.x_m, y, angle]))) is None for angle in phi)
