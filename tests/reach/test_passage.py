"""The scenario passage-clutter: its task, its geometry, and reaches in it."""

import dataclasses
import itertools

import numpy as np
import pytest
from support.kinematics import only
from support.worlds import ARM, corners, gap_to_boxes

from lic_drake.errors import RequestError
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest, is_within_reach
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach
from lic_drake.reach.start import Start

SCENARIO = load_scenario("passage-clutter")
STARTS = SCENARIO.task.start_line.grid(ARM)
INSTANCES = [SCENARIO.sample_instance("training", index) for index in range(200)]


def test_the_walls_keep_clear_of_the_start_line_and_of_the_arm_at_every_start() -> None:
    # Of the whole family of passages, its corners included.
    extremes = [
        dataclasses.replace(
            SCENARIO.clutter,
            centre_from=centre,
            centre_to=centre,
            min_slope_deg=slope,
            max_slope_deg=slope,
        ).sample(np.random.default_rng(0))
        for centre, slope in itertools.product(
            (SCENARIO.clutter.centre_from, SCENARIO.clutter.centre_to),
            (SCENARIO.clutter.min_slope_deg, SCENARIO.clutter.max_slope_deg),
        )
    ]
    starts = [q for q in (only(ARM.solve_ik(x0)) for x0 in STARTS) if q is not None]
    assert len(starts) == 14
    for instance in (*extremes, *INSTANCES[:40]):
        assert min(corners(instance, i)[:, 0].min() for i in (0, 1)) > 0.4
        assert min(gap_to_boxes(q, instance) for q in starts) > 0.05


def test_the_goal_is_within_reach_and_mostly_the_hand_fits_into_the_passage() -> None:
    # With the tip in the middle the hand, 3 cm wide and longer than half a passage, may be turned
    # by atan(3.5 / 20) = 10 degrees until it touches the end of a wall.
    fits = []
    for instance in INSTANCES:
        assert instance.p_WG is not None
        assert is_within_reach(SCENARIO, instance.p_WG)
        turned = instance.yaw[0] + np.deg2rad(np.arange(-10.0, 11.0))
        poses = [np.array([*instance.p_WG[:2], phi]) for phi in turned]
        fits.append(any(only(ARM.solve_ik(x0)) is not None for x0 in poses))
    assert 0.8 < np.mean(fits) < 1.0


def test_an_environment_offers_its_centre_as_the_only_goal() -> None:
    for stream, environment in (("training", 0), ("evaluation", 0), ("evaluation", 7)):
        instance = SCENARIO.sample_instance(stream, environment)
        goals = SCENARIO.goals(stream, environment)
        np.testing.assert_array_equal(goals, [SCENARIO.sample_goal(stream, environment)])
        np.testing.assert_allclose(goals[0], instance.p_WO.mean(axis=0), atol=1e-15)
    with pytest.raises(RequestError, match="passage-clutter offers 1 goal, 2 were asked for"):
        SCENARIO.sample_goal("evaluation", 0, 1)


def test_a_reach_into_a_passage_is_recorded_and_depends_on_its_request_only() -> None:
    instance = SCENARIO.sample_instance("training", 0)
    assert instance.p_WG is not None
    # Where the axis of the passage comes nearest to the start line the way in is straight.
    outcomes = set()
    for x0 in STARTS[[2, 7, 9]]:
        request = ReachRequest(SCENARIO, "training", 0, instance.p_WG, Start(x0))
        record = run_reach(request)
        outcomes.add(record.outcome)
        assert record.category == "passage-clutter"
        np.testing.assert_array_equal(record.p_WG, instance.p_WG)
        assert record.success == (record.min_distance < 0.015)
        result = Environment(SCENARIO, instance).reach(instance.p_WG, x0)
        assert (result.outcome, result.trace.time_s[-1]) == (record.outcome, record.duration_s)
        assert tuple(result.trace.q[-1].tolist()) == record.q_final
    assert "reached" in outcomes


def test_no_part_of_the_arm_passes_into_a_wall_during_a_reach() -> None:
    touched = 0
    for environment in range(3):
        instance = SCENARIO.sample_instance("training", environment)
        assert instance.p_WG is not None
        result = Environment(SCENARIO, instance).reach(instance.p_WG, STARTS[3 * environment])
        gaps = [gap_to_boxes(q, instance) for q in result.trace.q]
        # The skin yields by less than 1 mm: it is 15 mm thick, and a wall 20 mm.
        assert min(gaps) > -1e-3
        touched += np.count_nonzero(np.array(gaps) < 0.0)
    assert touched > 10
