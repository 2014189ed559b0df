from dataclasses import replace

import numpy as np
import pytest
from support.reaches import free_space, reach_request, small_clutter
from support.worlds import cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import make_record
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult

X0 = reach_request(free_space()).start.x0
P_WG = np.array([0.6, 0.1, 0.0])


def rounded(values: np.ndarray) -> np.ndarray:
    """Values with so few binary digits that adding a power of two is exact."""
    return np.round(values * 2**24) / 2**24


def reach_moved(
    scenario: Scenario,
    instance: ClutterInstance,
    p_WG: np.ndarray,
    x0: np.ndarray,
    offset: np.ndarray,
    sleep: bool,
) -> ReachResult:
    """A reach with everything, the base too, moved by an offset."""
    environment = Environment(scenario, instance.translated(offset), sleep, offset)
    return environment.reach(p_WG + offset, x0 + offset, keep_states=True)


@pytest.mark.parametrize(
    ("environment", "goal", "start", "offset"),
    [
        (0, [0.7, 0.0, 0.0], [0.335, 0.0, np.deg2rad(90.0)], [0.0, 0.5, 0.0]),
        (2, [0.7, 0.0, 0.0], [0.335, -0.2, np.deg2rad(30.0)], [-2.0, 0.25, 0.0]),
    ],
)
def test_a_reach_is_the_same_wherever_everything_together_is(
    environment: int, goal: list[float], start: list[float], offset: list[float], sleep: bool
) -> None:
    scenario, by = small_clutter(2.5), np.array(offset)
    drawn = scenario.sample_instance("training", environment)
    instance = drawn.with_objects_at(rounded(drawn.p_WO[drawn.movable, :2]))
    instance.p_WO[~instance.movable] = rounded(instance.p_WO[~instance.movable])
    p_WG, x0 = rounded(np.array(goal)), np.array([*rounded(np.array(start[:2])), start[2]])
    here = reach_moved(scenario, instance, p_WG, x0, np.zeros(3), sleep)
    there = reach_moved(scenario, instance, p_WG, x0, by, sleep)
    assert max(here.trace.contacts) > 0 and there.outcome == here.outcome
    # Translations are exact here, so that even contact makes nothing of them.
    np.testing.assert_array_equal(there.trace.q, here.trace.q)
    for name in ("time_s", "peak_force", "total_force", "contacts"):
        assert getattr(there.trace, name) == getattr(here.trace, name)
    np.testing.assert_allclose(
        np.array(there.trace.p_WE) - by, np.array(here.trace.p_WE), atol=1e-12
    )
    for name in ("q_clutter", "v_clutter"):
        moved = np.array([getattr(state, name) for state in there.trace.states])
        still = np.array([getattr(state, name) for state in here.trace.states])
        np.testing.assert_allclose(
            moved - (by[:2] if name == "q_clutter" else 0.0), still, atol=1e-12
        )
    np.testing.assert_allclose(there.trace.q_clutter - by[:2], here.trace.q_clutter, atol=1e-12)
    np.testing.assert_array_equal(there.trace.b0, by)


def test_a_base_aside_is_what_brings_a_goal_into_reach() -> None:
    scenario = free_space()
    far, aside = np.array([0.6, 0.9, 0.0]), np.array([0.0, 0.8, 0.0])
    nothing = make_clutter()
    assert Environment(scenario, nothing).reach(far, X0).outcome == "unreachable"
    environment = Environment(scenario, nothing, b0=aside)
    result = environment.reach(far, X0 + aside)
    assert result.outcome == "reached"
    assert np.linalg.norm(result.trace.p_WE[-1] - far) < scenario.stop.success_distance_m
    # The goal and the start of a base at the origin are both too far for it now.
    assert environment.reach(np.array([0.6, -0.2, 0.0]), X0 + aside).outcome == "unreachable"
    assert environment.reach(far, X0).outcome == "invalid_start"


def test_traces_and_records_are_in_the_world(sleep: bool) -> None:
    scenario, b0 = small_clutter(1.0), np.array([0.0, -0.25, 0.0])
    request = reach_request(scenario, (0.65, -0.3), y_m=-0.2, phi_deg=60.0)
    request = replace(request, start=Start(request.start.x0, b0))
    instance = scenario.sample_instance(request.stream, request.environment)
    result = Environment(scenario, instance, sleep, b0).reach(
        request.goal, request.start.x0, keep_states=True
    )
    arm, trace = scenario.arm(), result.trace
    np.testing.assert_array_equal(trace.b0, b0)
    drawn = instance.p_WO[instance.movable, :2]
    np.testing.assert_allclose(trace.states[0].q_clutter, drawn, atol=1e-12)
    np.testing.assert_array_equal(trace.states[-1].q_clutter, trace.q_clutter)
    p_WE = [arm.calc_pose(q).p_RE + b0 for q in trace.q]
    np.testing.assert_allclose(trace.p_WE, p_WE, atol=1e-12)
    np.testing.assert_allclose(p_WE[0][:2], request.start.x0[:2], atol=1e-12)
    record = make_record(request, result, 0.0)
    assert (record.base_x, record.base_y, record.after) == (0.0, -0.25, ())
    assert ReachRequest.from_record(record, scenario) == request
    x_final = [record.final_x, record.final_y, record.final_phi]
    np.testing.assert_allclose(x_final, arm.tip_pose(trace.q[-1]) + b0, atol=1e-12)
    assert record.min_distance == np.linalg.norm(trace.p_WE - record.p_WG, axis=1).min()
    # Not that of another frame: the hand came from 0.33 m away.
    assert record.min_distance < 0.33


@pytest.mark.parametrize("fixed", [True, False])
def test_objects_that_touch_each_other_are_no_reason_to_refuse_a_start(
    sleep: bool, fixed: bool
) -> None:
    scenario = free_space(0.2)
    pair = [cylinder(0.7, 0.3, movable=True), cylinder(0.7, 0.3199, movable=not fixed)]
    environment = Environment(scenario, make_clutter(*pair), sleep=sleep)
    assert environment.reach(P_WG, X0).outcome == "timeout"
    # An object that the arm touches is one, with or without such a pair.
    at_the_hand = cylinder(*X0[:2], movable=True)
    for objects in (pair, []):
        environment = Environment(scenario, make_clutter(*objects, at_the_hand), sleep=sleep)
        assert environment.reach(P_WG, X0).outcome == "invalid_start"
