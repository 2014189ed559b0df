import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.reach.task import StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.select.situation import Situation, StartSet

ARM = planar_arm()
STARTS = StartSet(arm=ARM, line=StartLine())
GOAL = np.array([0.6, 0.1, 0.0])


def test_every_start_of_the_sets_is_one_the_arm_can_take() -> None:
    assert len(STARTS.grid) == 21
    for x0 in np.vstack([STARTS.grid, STARTS.lattice]):
        q = ARM.solve_ik(x0)
        assert q is not None
        assert np.all(q >= ARM.q_min - 1e-9)
        assert np.all(q <= ARM.q_max + 1e-9)
        assert STARTS.contains(x0)


def test_the_whole_arm_is_behind_the_start_line_at_every_start() -> None:
    for x0 in STARTS.lattice:
        q = ARM.solve_ik(x0)
        assert q is not None
        assert ARM.kinematics.link_origins(q)[:, 0].max() <= x0[0] + 1e-9


def test_poses_off_the_line_or_beyond_the_joint_limits_are_not_contained() -> None:
    assert not STARTS.contains(np.array([0.4, 0.0, 1.0]))
    assert not STARTS.contains(np.array([0.335, 0.5, 1.0]))
    assert not STARTS.contains(np.array([0.335, 0.3, 0.0]))


@given(st.lists(st.floats(-0.4, 0.4), max_size=5), st.floats(-0.4, 0.4))
def test_free_intervals_are_the_allowed_positions(failed_y: list[float], y: float) -> None:
    failed = tuple(np.array([0.335, value, 0.5]) for value in failed_y)
    situation = Situation(p_WG=GOAL, starts=STARTS, failed=failed)
    inside = any(low <= y <= high for low, high in situation.free_intervals())
    allowed = bool(situation.allowed(np.array([[0.335, y, 0.0]]))[0])
    near_an_edge = any(abs(abs(y - value) - 0.1) < 1e-5 for value in failed_y)
    assert inside == allowed or near_an_edge
