from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.fake_reach import comparable
from support.kinematics import only
from support.reaches import (
    assert_never_began,
    free_space,
    reach_request,
    small_clutter,
    start_angles,
)
from support.worlds import box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession, make_record, run_reach
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult, ReachTrace

FREE = free_space()
X0 = reach_request(FREE).start.x0


def in_clutter(
    instance: ClutterInstance,
    goal: tuple[float, float] = (0.6, 0.1),
    sleep: bool = True,
    **values: Any,
):
    """Runs a reach from the easy start in hand-made clutter."""
    scenario = free_space(**values)
    return Environment(scenario, instance, sleep).reach(np.array([*goal, 0.0]), X0)


# Outcomes


def test_a_reach_in_free_space_arrives_without_touching_anything() -> None:
    request = reach_request(FREE)
    record = run_reach(request)
    arm = FREE.arm()
    assert (record.outcome, record.success, record.detail) == ("reached", True, "")
    assert record.min_distance < FREE.stop.success_distance_m
    assert (record.peak_force, record.mean_force, record.peak_contacts) == (0.0, 0.0, 0)
    assert record.mean_contacts == 0.0
    np.testing.assert_array_equal(record.q_start, only(arm.solve_ik(X0)))
    final = [record.final_x, record.final_y, record.final_phi]
    np.testing.assert_allclose(final, arm.tip_pose(np.array(record.q_final)))
    assert np.linalg.norm(np.subtract(final[:2], [0.6, 0.1])) == pytest.approx(record.min_distance)
    # The arm comes to the goal, so it moves towards it, and at most at 0.5 m/s.
    velocity = np.array([record.final_vx, record.final_vy])
    assert velocity @ (np.array([0.6, 0.1]) - final[:2]) > 0.0
    assert 0.0 < np.linalg.norm(velocity) < 0.5
    assert 0.0 < record.duration_s < FREE.stop.timeout_s
    assert record.duration_s / FREE.mpc.period_s == pytest.approx(
        round(record.duration_s / FREE.mpc.period_s)
    )
    assert record.wall_time_s > 0.0
    assert (record.key, record.scenario) == (request.key, FREE.digest)
    assert (record.category, record.robot) == ("cylinder-clutter", "planar-arm")
    assert (record.stream, record.environment) == ("training", 0)
    assert (tuple(record.p_WG), Start(record.start.x0)) == (tuple(request.goal), request.start)


def test_a_wall_leaves_the_arm_stuck_pressing_against_it() -> None:
    wall = make_clutter(box(0.5, 0.0, (0.04, 0.8, 0.2)))
    outcome, trace, _ = in_clutter(wall, (0.7, 0.0))
    assert outcome == "stuck"
    # The round end of the last link, 15 mm in radius, stands on the wall's front at x = 0.48.
    x, _, phi = FREE.arm().tip_pose(trace.q[-1])
    assert x - 0.015 * np.cos(phi) + 0.015 == pytest.approx(0.48, abs=5e-4)
    assert 0.0 < trace.peak_force[-1]
    assert trace.time_s[-1] > FREE.stop.stuck_time_s


def test_a_hard_knock_ends_the_reach_by_force() -> None:
    scenario = load_scenario("cylinder-clutter", "{stop: {force_limit_N: 1, force_time_s: 0.1}}")
    wall = make_clutter(box(0.5, 0.0, (0.04, 0.8, 0.2)))
    outcome, trace, _ = Environment(scenario, wall).reach(np.array([0.7, 0.0, 0.0]), X0)
    assert outcome == "force"
    # 0.1 s are three control periods: the last sample below the limit and three above it.
    assert [force > 1.0 for force in trace.peak_force[-4:]] == [False, True, True, True]


def test_given_joint_angles_are_executed_if_they_bring_the_hand_to_its_start() -> None:
    request = reach_request(free_space(timeout_s=0.1))
    q = FREE.arm().solve_ik(X0)[0]
    # In the plane they are the only ones, so that the request is the same.
    record = run_reach(replace(request, start=Start(X0, q=q + [3e-5, 0.0, 0.0])))
    np.testing.assert_array_equal(record.q_start, q + [3e-5, 0.0, 0.0])
    record = run_reach(replace(request, start=Start(X0, q=q + [1e-3, 0.0, 0.0])))
    assert_never_began(record, "invalid_start", q + [1e-3, 0.0, 0.0])
    assert record.detail == "the joint angles do not bring the hand to x0"


@pytest.mark.parametrize("goal", [(0.9, 0.3), (-5.0, 5.0)])
def test_goals_out_of_reach_are_not_simulated(goal: tuple[float, float]) -> None:
    record = run_reach(reach_request(FREE, goal))
    assert_never_began(record, "unreachable")
    assert record.detail == "the goal is beyond the arm's reach"


@pytest.mark.parametrize("start", [(0.335, 0.0, -np.pi / 2), (9.0, 9.0, 9.0), (-5.0, 0.0, 0.0)])
def test_a_start_without_a_configuration_is_invalid(start: tuple[float, float, float]) -> None:
    record = run_reach(replace(reach_request(FREE), start=Start(np.array(start))))
    assert_never_began(record, "invalid_start")
    assert record.detail == "no configuration within the joint limits"


def test_a_start_that_touches_a_cylinder_is_invalid() -> None:
    crowded = load_scenario(
        "cylinder-clutter",
        "{clutter: {num_movable: 0, num_fixed: 1, lower: [0.33, -0.005], upper: [0.34, 0.005]}}",
    )
    record = run_reach(reach_request(crowded))
    assert_never_began(record, "invalid_start")
    assert record.detail == "the arm touches the clutter at its start"


@pytest.mark.parametrize("movable", [False, True])
def test_touching_begins_where_the_surfaces_meet(movable: bool, sleep: bool) -> None:
    # The last link's round end reaches as far as the tip; the cylinder's radius is 10 mm.
    along = np.array([np.cos(X0[2]), np.sin(X0[2])])
    for gap, expected in ((0.0003, False), (-0.0003, True)):
        x, y = X0[:2] + (0.010 + gap) * along
        post = make_clutter(cylinder(x, y, movable=movable))
        outcome, trace, _ = in_clutter(post, sleep=sleep, timeout_s=0.1)
        assert (outcome == "invalid_start") == expected
        assert (trace.q == []) == expected


@pytest.mark.parametrize(("outcome", "vx"), [("stuck", 0.1), ("timeout", 0.0)])
def test_the_figures_of_a_record_come_from_the_trace(outcome: str, vx: float) -> None:
    # 2 s at 0.1 m/s along x, then at rest for as long as the stuck rule asks.
    trace, still_s = ReachTrace(), FREE.stop.stuck_time_s
    q = np.array([0.1, 0.2, 0.3])
    for k in range(round((2.0 + still_s) / 0.04) + 1):
        p_WE = np.array([0.1 * min(0.04 * k, 2.0), 0.0, 0.0])
        trace.append(0.04 * k, q, p_WE, np.array([4.0, 0.0, 2.0]) * (k % 2))
    request = reach_request(FREE, (0.3, 0.0))
    record = make_record(request, ReachResult(outcome, trace, "why"), 1.5)
    assert (record.final_vx, record.final_vy) == (pytest.approx(vx), 0.0)
    # The smallest distance is that of the trace's tips, the final pose that of q.
    assert record.min_distance == pytest.approx(0.1)
    np.testing.assert_allclose(
        [record.final_x, record.final_y, record.final_phi], FREE.arm().tip_pose(q)
    )
    assert (record.q_start, record.q_final) == ((0.1, 0.2, 0.3),) * 2
    assert (record.peak_force, record.mean_force, record.peak_contacts) == (4.0, 3.0, 2)
    assert record.mean_contacts == pytest.approx(1.0, abs=0.01)
    assert record.duration_s == pytest.approx(2.0 + still_s)
    assert (record.wall_time_s, record.detail) == (1.5, "why")


# The record is a function of the request


def requests() -> list[ReachRequest]:
    """Reaches with and without contact in three environments, one that never begins."""
    scenario = small_clutter(2.0)
    return [
        reach_request(scenario, (0.6, 0.1), environment=0),
        reach_request(scenario, (0.65, -0.1), 0.1, 60.0, environment=1),
        reach_request(scenario, (0.6, 0.1), phi_deg=-90.0, environment=1),
        reach_request(scenario, (0.7, 0.0), -0.2, 30.0, environment=2),
        reach_request(scenario, (0.7, 0.0), 0.0, 90.0, environment=0),
    ]


def test_records_do_not_depend_on_what_ran_before_in_the_process(session: ReachSession) -> None:
    expected = [ReachSession(session.sleep).run(request) for request in requests()]
    assert any(record.peak_contacts > 0 for record in expected)
    in_a_row = list(map(session.run, requests()))
    # NaN is not equal to itself, hence the comparison as text; dataclasses compare the others.
    assert comparable(in_a_row) == comparable(expected)
    backwards = list(map(session.run, reversed(requests())))
    assert comparable(backwards[::-1]) == comparable(expected)
    assert session.run(requests()[0]) == expected[0]


# Time


def test_samples_are_a_control_period_apart_from_zero() -> None:
    scenario = free_space(0.4)
    trace = Environment(scenario, make_clutter()).reach(np.array([0.6, 0.1, 0.0]), X0).trace
    np.testing.assert_allclose(trace.time_s, 0.04 * np.arange(11), atol=1e-12)
    np.testing.assert_array_equal(trace.q[0], start_angles(scenario))
    arm = scenario.arm()
    np.testing.assert_allclose(trace.p_WE, [arm.calc_pose(q).p_RE for q in trace.q])


def test_the_integrators_agree_in_free_space() -> None:
    tips = []
    for time_step_s in (0.0, 0.005, 0.0005):
        scenario = load_scenario(
            "cylinder-clutter",
            f"{{scene: {{time_step_s: {time_step_s}}}, stop: {{timeout_s: 2}}}}",
        )
        trace = Environment(scenario, make_clutter()).reach(np.array([0.7, 0.1, 0.0]), X0).trace
        tips.append(np.array(trace.p_WE))
    assert np.linalg.norm(np.ptp(tips[0], axis=0)) > 0.05
    np.testing.assert_allclose(tips[0], tips[2], atol=5e-4)
    np.testing.assert_allclose(tips[1], tips[2], atol=2e-3)
