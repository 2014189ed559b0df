"""Any robot reaches free goals, and its force settles at the controller's threshold."""

from pathlib import Path

import numpy as np
import pytest
from support.six_joint_arm import write

from lic_drake.clutter.instance import join
from lic_drake.errors import ScenarioError
from lic_drake.evaluate.robot_check import RobotCheck, check_robot
from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import load_scenario


def assert_reaches_and_settles(check: RobotCheck) -> None:
    assert check.reaches and check.settles
    threshold = check.scenario.mpc.force_threshold_N
    assert check.settled_N[1] == pytest.approx(threshold, rel=0.1)
    assert max(check.free.trace.peak_force) == 0.0
    values = check.values()
    assert values["free_goal"] == "reached" and values["free_goal_distance_m"] < 0.015
    assert values["taxels"] > 100 and values["skin_area_m2"] > 0.01


@pytest.mark.parametrize("name", ["planar-arm", "pr2", "iiwa14", "panda"])
def test_arms_reach_and_press(name: str) -> None:
    assert_reaches_and_settles(check_robot(name))


def test_an_arm_from_a_file_reaches_and_presses(tmp_path: Path) -> None:
    assert_reaches_and_settles(check_robot(str(write(tmp_path))))


def test_an_arm_that_touches_itself_at_home_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path, "home_deg: -50.0", "home_deg: 80.0")
    with pytest.raises(ScenarioError, match=r"itself in its home posture: .* and .*; give"):
        check_robot(str(path))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pr2", "iiwa14", "panda"])
def test_in_free_space_the_tip_comes_within_a_centimetre_of_its_goals(name: str) -> None:
    overrides = f"{{robot: {name}, stop: {{success_distance_m: 0.01}}, mpc: {{deadzone_m: 0.0}}}}"
    scenario = load_scenario("sphere-aperture-clutter", overrides)
    arm, b0 = scenario.arm(), scenario.task.b0
    environment = Environment(scenario, join(), sleep=False)
    x0 = arm.tip_pose(arm.q_home) + np.pad(b0, (0, 4))
    rng = np.random.default_rng(0)
    places = x0[:3] - b0 + rng.uniform([0.0, -0.3, -0.3], [0.3, 0.3, 0.2], (100, 3))
    found = arm.solve_pointing(places, np.array([1.0, 0.0, 0.0]))
    goals = [place + b0 for place, q in zip(places, found, strict=True) if len(q)]
    reached = [environment.reach(p_WG, x0, q=arm.q_home).outcome == "reached" for p_WG in goals]
    print(f"{name}: {sum(reached)} of {len(goals)}")
    assert len(goals) > 50 and np.mean(reached) >= 0.95
