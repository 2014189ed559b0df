from itertools import pairwise

import numpy as np
import pytest
from support.pr2_reaches import SCENARIO

from lic_drake.show.approach import RETREAT_STEP_M, WAITING_DEG, Approach
from lic_drake.starts import board_starts

INSTANCE = SCENARIO.sample_instance("training", 0)
STARTS = board_starts(SCENARIO, INSTANCE)
APPROACH = Approach(SCENARIO, INSTANCE)


# To the last one the direct way is blocked, and the arm's limits allow no straight way.
@pytest.mark.parametrize(("index", "straight"), [(0, True), (16, True), (9, False)])
def test_the_arm_comes_straight_in_and_touches_nothing(index: int, straight: bool) -> None:
    b0, q_start = STARTS.grid.b0[index], STARTS.grid.q[index]
    path = APPROACH.path(b0, q_start)
    np.testing.assert_allclose(path[[0, -1]], [np.deg2rad(WAITING_DEG), q_start])
    arm = SCENARIO.arm()
    assert np.all((path >= arm.q_min) & (path <= arm.q_max))
    for a, b in pairwise(path):
        for q in np.linspace(a, b, 1 + int(np.ceil(np.abs(b - a).max() / 0.02))):
            assert not STARTS.checker.touches(b0, q)
    if straight:  # The last centimetres at least, and the tool does not turn.
        R_RE, way = arm.calc_pose(q_start).R_RE, 3 * RETREAT_STEP_M
        p_RE = [arm.calc_pose(q).p_RE for q in path[[-4, -1]]]
        np.testing.assert_allclose(p_RE[1] - p_RE[0], way * R_RE[:, 0], atol=1e-3)
        np.testing.assert_allclose(arm.calc_pose(path[-4]).R_RE, R_RE, atol=1e-3)


def test_base_and_torso_may_go_anywhere_while_the_arm_waits() -> None:
    stand = SCENARIO.task.stand
    assert stand is not None
    for y_m in np.linspace(stand.y_min_m, stand.y_max_m, 7):
        for torso_m in np.linspace(stand.torso_min_m, stand.torso_max_m, 4):
            b0 = np.array([0.0, y_m, torso_m])
            assert not STARTS.checker.touches(b0, np.deg2rad(WAITING_DEG))
