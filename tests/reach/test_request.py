import dataclasses
import math
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from support.fake_reach import make_record
from support.reaches import reach_request

from lic_drake.errors import RequestError
from lic_drake.experience.schema import to_records
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import (
    ReachRecord,
    ReachRequest,
    check_goal,
    make_request,
    request_of,
)
from lic_drake.reach.scenario import load_scenario

SCENARIO = load_scenario("cylinder-clutter")


def test_keys_are_unique_over_scenarios_streams_environments_goals_and_starts() -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 29}}")
    starts = SCENARIO.task.start_line.grid(SCENARIO.arm())
    requests = [
        ReachRequest(
            scenario=scenario,
            stream=stream,
            environment=environment,
            goal=tuple(goal.tolist()),
            start=tuple(start.tolist()),
        )
        for scenario in (SCENARIO, other)
        for stream in ("training", "evaluation")
        for environment in (0, 1, 10)
        for goal in SCENARIO.task.goal_area.grid()[::7]
        for start in starts
    ]
    keys = {request.key for request in requests}
    assert len(keys) == len(requests) == 2 * 2 * 3 * 7 * 21
    assert all(len(key) == 16 and int(key, 16) >= 0 for key in keys)


def test_the_smallest_change_of_a_number_changes_the_key() -> None:
    request = reach_request(SCENARIO)
    x, y, z = request.goal
    a, b, c = request.start
    twins = [
        request,
        replace(request, goal=(math.nextafter(x, 1.0), y, z)),
        replace(request, goal=(x, math.nextafter(y, 1.0), z)),
        replace(request, goal=(x, y, 1e-300)),
        replace(request, start=(math.nextafter(a, 1.0), b, c)),
        replace(request, start=(a, 5e-324, c)),
        replace(request, start=(a, b, math.nextafter(c, 1.0))),
        replace(request, goal=request.start, start=request.goal),
    ]
    assert len({twin.key for twin in twins}) == len(twins)


def test_keys_are_the_same_in_another_process() -> None:
    script = (
        "from lic_drake.reach.request import ReachRequest\n"
        "from lic_drake.reach.scenario import load_scenario\n"
        "print(ReachRequest(scenario=load_scenario('cylinder-clutter'), stream='training',"
        f" environment=0, goal={reach_request(SCENARIO).goal},"
        f" start={reach_request(SCENARIO).start}).key)"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=environment
    )
    assert result.stdout.strip() == reach_request(SCENARIO).key


def test_numpy_numbers_give_the_key_of_plain_ones() -> None:
    request = reach_request(SCENARIO)
    assert replace(request, goal=tuple(np.array(request.goal))).key == request.key


def test_a_request_from_arrays_holds_plain_numbers() -> None:
    expected = reach_request(SCENARIO, environment=3)
    request = make_request(
        SCENARIO, "training", 3, np.array(expected.goal), np.array(expected.start)
    )
    assert request == expected
    assert all(type(value) is float for value in (*request.goal, *request.start))


def test_records_are_compared_without_their_wall_time() -> None:
    record = next(
        record
        for environment in range(9)
        if (record := make_record(reach_request(SCENARIO, environment=environment))).detail == ""
    )
    assert record == replace(record, wall_time_s=record.wall_time_s + 1.0)
    for item in dataclasses.fields(ReachRecord):
        value = getattr(record, item.name)
        if item.name != "wall_time_s":
            assert record != replace(record, **{item.name: (value, "changed")}), item.name


def test_a_records_goal_and_start_are_vectors() -> None:
    request = reach_request(SCENARIO, goal=(0.6, 0.1), y_m=0.2, phi_deg=60.0)
    record = make_record(request)
    np.testing.assert_array_equal(record.p_WG, [0.6, 0.1, 0.0])
    np.testing.assert_array_equal(record.x0, [0.335, 0.2, np.deg2rad(60.0)])


def test_every_field_of_a_record_says_what_it_is() -> None:
    for item in dataclasses.fields(ReachRecord):
        assert set(item.metadata["unit"].split(", ")) <= {"", "m", "rad", "m/s", "N", "s"}
        assert item.metadata["doc"]


@pytest.mark.parametrize(
    "p_WG", [[np.nan, 0.0, 0.0], [0.5, np.inf, 0.0], [0.5, 0.0], [[0.5, 0.0, 0.0]]]
)
def test_goals_must_be_finite_points(p_WG: list[float]) -> None:
    with pytest.raises(RequestError, match="a goal is two finite numbers in metres, got"):
        check_goal(SCENARIO, np.array(p_WG))


def test_goals_out_of_reach_are_refused_with_the_distance() -> None:
    # 0.196 + 0.334 + 0.288 m of arm and the distance that counts as reached.
    reach = 0.818 + SCENARIO.stop.success_distance_m
    check_goal(SCENARIO, np.array([0.0, -(reach - 1e-9), 0.0]))
    with pytest.raises(RequestError) as caught:
        check_goal(SCENARIO, np.array([0.9, 0.3, 0.0]))
    assert str(caught.value) == (
        "the goal (0.9, 0.3) m is 0.949 m from the base and the arm reaches"
        f" {reach:.3f} m; choose a nearer goal"
    )
    with pytest.raises(RequestError):
        check_goal(SCENARIO, np.array([reach + 1e-6, 0.0, 0.0]))


# A base that moves, and reaches that went before


def test_the_keys_of_the_shipped_libraries_are_those_of_their_requests() -> None:
    # A base at the origin and no earlier reach leave keys as they were before there was either.
    for name in ("cylinder-clutter", "passage-clutter"):
        library = ExperienceLibrary(shipped_library(name))
        scenario, records = library.scenario(), to_records(library.table().slice(0, 400))
        for record in records:
            request = request_of(record, scenario)
            assert (request.base, request.after) == ((0.0, 0.0), ())
            assert request.key == record.key
            assert request == make_request(
                scenario, record.stream, record.environment, record.p_WG, record.x0
            )


def test_a_base_or_an_earlier_reach_makes_another_key() -> None:
    request = reach_request(SCENARIO)
    x0, here = np.array(request.start), np.zeros(2)
    second = request.then(x0, here)
    twins = [
        request,
        replace(request, base=(0.0, 0.1)),
        replace(request, base=(0.1, 0.0)),
        replace(request, base=(0.0, 5e-324)),
        second,
        second.then(x0, here),
        request.then(x0, np.array([0.0, 0.1])),
        replace(request, base=(0.0, 0.1)).then(x0, here),
        request.then(x0 + [0.0, 0.0, 1e-15], here),
        replace(request, start=(0.335, 0.1, 1.0)).then(x0, here),
    ]
    assert len({twin.key for twin in twins}) == len(twins)
    assert all(len(twin.key) == 16 for twin in twins)


def test_a_base_of_minus_zero_is_at_the_origin() -> None:
    request = reach_request(SCENARIO)
    x0, p_WG = np.array(request.start), np.array(request.goal)
    minus = make_request(SCENARIO, "training", 0, p_WG, x0, np.array([-0.0, -0.0]))
    assert minus.key == request.key
    assert request.then(x0, np.array([-0.0, 0.0])).key == request.then(x0, np.zeros(2)).key


def test_a_base_is_given_in_the_plane_or_in_space() -> None:
    request = reach_request(SCENARIO)
    x0, p_WG = np.array(request.start), np.array(request.goal)
    for p_WR in (np.array([0.1, -0.2]), np.array([0.1, -0.2, 0.0])):
        made = make_request(SCENARIO, "training", 0, p_WG, x0, p_WR)
        assert made.base == (0.1, -0.2)
        np.testing.assert_array_equal(made.p_WR, [0.1, -0.2, 0.0])
        assert request.then(x0, p_WR).base == (0.1, -0.2)
        assert all(type(value) is float for value in made.base)
