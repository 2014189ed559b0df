"""Numerical inverse kinematics of any arm: against the PR2's closed form, and for new arms."""

import numpy as np
import pytest

from lic_drake.robots.kinematics import Kinematics
from lic_drake.robots.pr2 import pr2_arm
from lic_drake.robots.registry import get_robot

AHEAD = np.array([1.0, 0.0, 0.0])
APERTURES = np.array(
    [[0.53, y, z] for y in np.linspace(-0.69, 0.11, 5) for z in (0.45, 0.65, 0.85)]
)


def test_without_a_closed_form_the_pr2s_starts_cost_the_same() -> None:
    kinematics = pr2_arm().kinematics
    places = np.vstack([APERTURES, APERTURES + [0.0, 0.07, -0.04]])
    general = Kinematics.solve_pointing(kinematics, places, AHEAD)
    closed = kinematics.solve_pointing(places, AHEAD)
    assert sum(map(len, closed)) > 1000
    assert all(len(q) > 0 for q, exact in zip(general, closed, strict=True) if len(exact))
    pairs = [(q[0], exact[0]) for q, exact in zip(general, closed, strict=True) if len(exact)]
    cost, best = (kinematics.calc_preselection_cost(np.array(q)) for q in zip(*pairs, strict=True))
    assert np.all(cost < 1.001 * best)
    # The closed form tries pan angles half a degree apart, and the best one is between two of them.
    assert np.median(cost / best) > 0.995 and np.min(cost / best) > 0.9


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
def test_new_arms_find_the_cheapest_starts_first(name: str) -> None:
    arm = get_robot(name)
    places = APERTURES[::3]
    found = arm.solve_pointing(places, AHEAD)
    assert sum(len(q) > 0 for q in found) > 3
    for place, q in zip(places, found, strict=True):
        for row in q[::10]:
            pose = arm.calc_pose(row)
            np.testing.assert_allclose(pose.p_RE, place, atol=1e-9)
            np.testing.assert_allclose(pose.R_RE[:, 0], AHEAD, atol=1e-9)
            assert np.all((row >= arm.q_min) & (row <= arm.q_max))
        assert np.all(np.diff(arm.kinematics.calc_preselection_cost(q)) >= 0.0)
        if len(q):  # The whole pose of the first one has it, or a cheaper one, as its first.
            (again, *_) = arm.solve_ik(arm.tip_pose(q[0]))
            costs = arm.kinematics.calc_preselection_cost(np.array([again, q[0]]))
            assert costs[0] <= 1.02 * costs[1]
