"""A robot from one file outside the package (`support.five_joint_arm`) reaches like the others."""

import numpy as np
from support.five_joint_arm import NAME

from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult

SCENARIO = load_scenario(
    "sphere-aperture-clutter", f"{{robot: {NAME}, task: {{torso_m: 0.85}}, stop: {{timeout_s: 5}}}}"
)
ARM = SCENARIO.arm()
B0 = np.array([0.0, -0.3, 0.85])


def reach_in(session: ReachSession, ahead_m: float) -> ReachResult:
    """From the centre of an aperture in front of the arm to a goal behind it."""
    p_WA = SCENARIO.sample_instance("training", 0).p_WA
    assert p_WA is not None
    p_WE = p_WA[np.argmin(np.linalg.norm(p_WA[:, 1:] - B0[1:], axis=1))]
    (found,) = ARM.solve_pointing(p_WE[None] - B0, np.array([1.0, 0.0, 0.0]))
    x0 = ARM.tip_pose(found[0]) + np.pad(B0, (0, 4))
    goal = p_WE + [ahead_m, 0.0, 0.0]
    request = ReachRequest(SCENARIO, "training", 0, goal, Start(x0, B0, found[0]))
    result = session.simulate(request)
    assert session.run(request).outcome == result.outcome
    return result


def test_it_pushes_spheres_aside_and_feels_them(session: ReachSession) -> None:
    result = reach_in(session, 0.15)
    assert result.outcome == "reached"
    assert max(result.trace.contacts) > 0
    first = SCENARIO.sample_instance("training", 0)
    assert result.trace.q_clutter is not None
    assert np.abs(result.trace.q_clutter - first.p_WO[first.movable]).max() > 0.01


def test_a_goal_beyond_its_length_is_out_of_reach(session: ReachSession) -> None:
    assert reach_in(session, 0.5).outcome == "unreachable"
