"""Reaches in MuJoCo end as in Drake where nothing, or little, is in the way."""

import numpy as np
import pytest
from support.reaches import free_space, reach_request, start_angles
from support.worlds import ARM, add_sensor, cylinder, make_clutter, make_world

from lic_drake.reach.environment import simulate
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import default_session
from lic_drake.reach.trace import ReachResult
from lic_drake.scene.scene import SceneConfig

pytest.importorskip("mujoco")

from scripts.mujoco.mujoco_scene import MujocoConfig
from scripts.mujoco.mujoco_simulation import MujocoSimulation


def start(scenario: Scenario, environment: int = 0, **config: float | bool) -> MujocoSimulation:
    instance = scenario.sample_instance("training", environment)
    return MujocoSimulation(scenario, instance, MujocoConfig(**config))


def reach(
    scenario: Scenario, simulation: MujocoSimulation, goal: tuple[float, float]
) -> ReachResult:
    return simulate(simulation, scenario, start_angles(scenario), np.array([*goal, 0.0]))


@pytest.mark.parametrize("goal", [(0.6, 0.1), (0.5, -0.2), (0.7, 0.3)])
def test_without_clutter_a_reach_arrives_when_drakes_does(goal: tuple[float, float]) -> None:
    scenario = free_space()
    mine = reach(scenario, start(scenario), goal)
    request = reach_request(scenario, goal)
    drake = default_session(True).simulate(request)
    assert mine.outcome == drake.outcome == "reached"
    assert mine.trace.time_s[-1] == pytest.approx(drake.trace.time_s[-1], abs=0.041)
    samples = min(len(mine.trace.q), len(drake.trace.q))
    np.testing.assert_allclose(mine.trace.q[:samples], drake.trace.q[:samples], atol=5e-3)
    assert max(mine.trace.peak_force) == 0.0


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("link", [1, 2])
def test_the_taxel_of_drakes_sensor_reads_the_force_that_the_joints_show(
    link: int, side: float
) -> None:
    q = np.deg2rad([-30.0, 60.0, 50.0])
    R_RL, p_RL = ARM.calc_pose(q)[:2]
    normal = side * R_RL[link, :, 0]
    p_RC = p_RL[link] + R_RL[link] @ (ARM.skin[link].p_LS + np.array([0.0, 0.02, 0.0]))
    clutter = make_clutter(cylinder(*(p_RC + 0.0252 * normal)[:2]))
    J = ARM.point_jacobians(ARM.calc_pose(q), np.array([link]), p_RC[None])[0]
    q_d = q + J.T @ (5.0 * normal) / ARM.stiffness

    drake = make_world(q, clutter, SceneConfig(time_step_s=0.005), extend=add_sensor)
    drake.set_equilibrium(q_d)
    drake.advance(6.0)
    mine = MujocoSimulation(free_space(), clutter, MujocoConfig())
    mine.begin(q, np.zeros(3))
    mine.data.ctrl[:] = q_d
    mine.step(1200)
    mine.sense()

    (taxel,) = np.flatnonzero(drake.taxel_force)
    assert np.flatnonzero(mine.taxel_force()) == [taxel]
    # Friction leaves a tangential force that depends on how the contact began.
    p_RC = p_RC + 0.015 * normal
    J = ARM.point_jacobians(ARM.calc_pose(mine.joint_angles()), np.array([link]), p_RC[None])[0]
    torque = ARM.stiffness * (q_d - mine.joint_angles())
    f_C = np.linalg.lstsq(J[:2].T, torque, rcond=None)[0]
    assert mine.taxel_force()[taxel] == pytest.approx(float(f_C @ normal[:2]), rel=0.02)
    assert f_C @ normal[:2] == pytest.approx(5.0, rel=0.15)
