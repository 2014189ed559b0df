from functools import cache

import numpy as np
import pytest
from support.reaches import free_space, start_angles
from support.worlds import cylinder, make_clutter

from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.environment import Environment
from lic_drake.reach.rig import Rig, Stepper
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.sleeping import SkinAxes
from lic_drake.reach.trace import ReachTrace

P_WG = np.array([0.75, 0.1, 0.0])
IN_THE_WAY = make_clutter(cylinder(0.6, 0.02))


def make_scenario(**scene: float) -> Scenario:
    """Free space with other parameters of the scene."""
    scenario = free_space()
    for name, value in scene.items():
        setattr(scenario.scene, name, value)
    return scenario


@cache
def reach(blocked: bool, **scene: float) -> ReachTrace:
    """A reach past nothing or past one fixed cylinder."""
    scenario = make_scenario(**scene)
    environment = Environment(scenario, IN_THE_WAY if blocked else make_clutter(), sleep=False)
    return environment.reach(P_WG, scenario.arm().tip_pose(start_angles(scenario))).trace


def largest_distance(first: ReachTrace, second: ReachTrace) -> float:
    """The largest distance of the tips at any instant of both, metres."""
    n = min(len(first.p_WE), len(second.p_WE))
    d = np.array(first.p_WE[:n]) - np.array(second.p_WE[:n])
    return float(np.linalg.norm(d, axis=1).max())


def test_in_free_space_four_single_solves_a_period_are_as_good_as_error_control() -> None:
    fine = reach(False, calm_move_m=0.0, cenic_max_step_s=0.001)
    chosen, calm = reach(False, calm_move_m=0.0), reach(False, calm_move_m=0.004)
    assert largest_distance(calm, fine) < 1.1 * largest_distance(chosen, fine) < 5e-4
    assert calm.statistics["iterations"] < 0.4 * chosen.statistics["iterations"]
    assert calm.statistics["periods"] == len(calm.q) - 1 and calm.statistics["repeated"] == 0
    assert calm.statistics["steps"] <= 4 * calm.statistics["periods"]


def test_an_impact_is_simulated_again_with_error_control() -> None:
    chosen, calm = reach(True, calm_move_m=0.0), reach(True, calm_move_m=0.004)
    careless = reach(True, calm_move_m=0.004, calm_change_N=1e6)
    assert 1 <= calm.statistics["repeated"] < 0.1 * calm.statistics["periods"]
    assert careless.statistics["repeated"] == 0
    peak = max(chosen.peak_force)
    assert max(calm.peak_force) == pytest.approx(peak, rel=0.01)
    assert max(careless.peak_force) > 1.3 * peak
    assert largest_distance(calm, chosen) < 1e-3


@pytest.mark.parametrize("calm_move_m", [0.0, 0.004])
def test_a_rig_that_goes_back_takes_the_same_way_again(calm_move_m: float) -> None:
    scenario = make_scenario(calm_move_m=calm_move_m)
    rig = Rig(make_reach_diagram(scenario, IN_THE_WAY))
    rig.diagram.set_start(rig.context, start_angles(scenario), P_WG)
    stepper = Stepper(rig)
    stepper.advance_to(0.4)
    instant = rig.save()
    ends = []
    for _ in range(2):
        rig.restore(instant)
        again = Stepper(rig)
        for k in range(11, 16):
            again.advance_to(0.04 * k)
        ends.append(rig.save())
    np.testing.assert_array_equal(ends[0].x, ends[1].x)
    np.testing.assert_array_equal(ends[0].held, ends[1].held)
    assert ends[0].time_s == ends[1].time_s == pytest.approx(0.6)
    assert np.abs(ends[0].x - instant.x).max() > 1e-3


@pytest.mark.parametrize("name", ["cylinder-clutter", "sphere-aperture-clutter"])
def test_no_part_of_the_skin_moves_faster_than_joint_speeds_times_levers(name: str) -> None:
    arm = load_scenario(name).arm()
    axes, rng, share = SkinAxes(arm, 2 if arm.is_planar else 3), np.random.default_rng(3), []
    for q in rng.uniform(arm.q_min, arm.q_max, (200, arm.num_joints)):
        turn = 1e-4 * rng.normal(size=arm.num_joints)
        moved = np.linalg.norm(axes.ends(q + turn) - axes.ends(q), axis=1).max()
        share.append(moved / (np.abs(turn) @ arm.levers))
    assert 0.5 < max(share) <= 1.0
