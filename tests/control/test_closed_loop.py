"""Sensor, controller and arm together, through the diagram of a reach."""

import numpy as np
import pytest
from support.kinematics import only
from support.reaches import start_context
from support.worlds import ARM, LAYOUT, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import parse_scenario

SCENARIO = """
category: cylinder-clutter
robot: planar-arm
scene:
  time_step_s: 0.005
  contact: {skin_modulus_Pa: 1.0e+8, skin_mesh_m: 0.005, object_mesh_m: 0.004}
"""
SUCCESS = 0.015


def run(
    overrides: str, clutter: ClutterInstance, q: np.ndarray, p_WG: np.ndarray, time: float
) -> tuple[np.ndarray, ...]:
    """Times, hand, taxel forces and objects at the control rate."""
    scenario = parse_scenario(SCENARIO, overrides)
    reach = make_reach_diagram(scenario, clutter)
    context = start_context(reach, q, p_WG)
    simulator = reach.make_simulator(context)
    samples = []
    for i in range(round(time * scenario.mpc.rate_hz) + 1):
        simulator.AdvanceTo(i * scenario.mpc.period_s)
        state, force, objects = (
            np.array(reach.diagram.GetOutputPort(name).Eval(context))
            for name in ("arm_state", "taxel_force", "clutter_state")
        )
        samples.append((context.get_time(), ARM.calc_pose(state[:3]).p_RE[:2], force, objects))
    return tuple(map(np.array, zip(*samples, strict=True)))


# From the start line into the goal area, from the right and from the left.
FROM_THE_RIGHT, FROM_THE_LEFT = (
    ((0.335, -0.4, 0.0), (0.7, -0.2)),
    ((0.335, 0.3, 90.0), (0.45, 0.35)),
)


@pytest.mark.parametrize(
    ("preset", "time", "bend", "start", "goal"),
    [
        # At 0.05 m/s the hand keeps to the line; it lags by half a second, each joint its own way.
        ("ijrr_2013", 12.0, 0.1, *FROM_THE_LEFT),
        # 0.5 m/s is more than half a degree a step allows: the joints turn at their limits, and
        # the hand takes a bend of up to a third of the distance.
        ("haptic_mpc_2013", 7.5, 0.45, *FROM_THE_RIGHT),
        ("haptic_mpc_2013", 7.5, 0.45, *FROM_THE_LEFT),
    ],
)
def test_in_free_space_the_hand_comes_to_the_goal_and_stays_there(
    preset: str,
    time: float,
    bend: float,
    start: tuple[float, float, float],
    goal: tuple[float, float],
) -> None:
    q = only(ARM.solve_ik(np.array([start[0], start[1], np.deg2rad(start[2])])))
    assert q is not None
    begin, end = np.array(start[:2]), np.array(goal)
    times, p_WE, taxel_force, _ = run(
        f"{{mpc: {{preset: {preset}}}}}", make_clutter(), q, np.append(end, 0.0), time
    )
    distance = np.linalg.norm(p_WE - end, axis=1)
    arrived = int(np.argmax(distance < SUCCESS))
    assert 0 < arrived < 0.9 * len(distance)
    # No overshoot out of the goal's tolerance.
    assert np.max(distance[arrived:]) < SUCCESS
    line = (end - begin) / np.linalg.norm(end - begin)
    aside = np.abs((p_WE - begin) @ [-line[1], line[0]])
    assert np.max(aside) < bend * np.linalg.norm(end - begin)
    assert np.all(taxel_force == 0.0)
    if preset == "ijrr_2013":
        mean = np.linalg.norm(end - begin) / times[arrived]
        assert 0.03 < mean < 0.05


@pytest.mark.parametrize(
    ("preset", "threshold", "time", "side"),
    [("haptic_mpc_2013", 3.0, 9.0, -1.0), ("ijrr_2013", 5.0, 11.0, 1.0)],
)
def test_against_a_fixed_cylinder_the_force_settles_at_the_threshold(
    preset: str, threshold: float, time: float, side: float
) -> None:
    q = np.deg2rad([-30.0, 60.0, 50.0])
    R_RL, p_RL = ARM.calc_pose(q)[:2]
    across, along = side * R_RL[2, :, 0], -R_RL[2, :, 1]
    # On link 3's side near the hand, 3 mm off; the goal is right behind it.
    obstacle = cylinder(*(p_RL[2] + 0.25 * along + 0.028 * across)[:2])
    goal = ARM.calc_pose(q).p_RE + 0.12 * across
    overrides = f"{{mpc: {{preset: {preset}, force_threshold_N: {threshold}}}}}"
    times, p_WE, taxel_force, _ = run(overrides, make_clutter(obstacle), q, goal, time)
    peak = taxel_force.max(axis=1)
    settled = peak[times > 0.75 * time]
    assert np.max(settled) < 1.2 * threshold
    assert np.mean(settled) == pytest.approx(threshold, rel=0.05)
    assert np.min(settled) > 0.8 * threshold
    loaded = np.unique(np.nonzero(taxel_force)[1])
    assert set(LAYOUT.link[loaded]) == {2}
    np.testing.assert_array_equal(LAYOUT.n_L[loaded, 0], side)
    # The cylinder keeps the hand from its goal.
    assert np.linalg.norm(p_WE[-1] - goal[:2]) > 0.05


@pytest.mark.parametrize("preset", ["haptic_mpc_2013", "ijrr_2013"])
def test_a_movable_cylinder_is_pushed_away_and_the_goal_reached(preset: str) -> None:
    q = np.deg2rad([-30.0, 60.0, 50.0])
    R_RL, p_RL = ARM.calc_pose(q)[:2]
    across, along = R_RL[2, :, 0], -R_RL[2, :, 1]
    obstacle = cylinder(*(p_RL[2] + 0.25 * along + 0.028 * across)[:2], movable=True)
    goal = ARM.calc_pose(q).p_RE + 0.12 * across
    _, p_WE, _, objects = run(
        f"{{mpc: {{preset: {preset}}}}}", make_clutter(obstacle), q, goal, 7.0
    )
    distance = np.linalg.norm(p_WE - goal[:2], axis=1)
    assert np.min(distance) < SUCCESS
    moved = objects[:, :2] - objects[0, :2]
    assert (moved @ across[:2])[-1] > 0.05
