import math
from dataclasses import replace

import numpy as np
import pytest
from support.fake_reach import make_record
from support.reaches import reach_request

from lic_drake.errors import RequestError
from lic_drake.experience.schema import to_records
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRequest, check_goal
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import make_record as real_record
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult, ReachTrace

SCENARIO = load_scenario("cylinder-clutter")


def test_keys_are_unique_over_scenarios_streams_environments_goals_and_starts() -> None:
    other = load_scenario("cylinder-clutter", "{stop: {timeout_s: 29}}")
    starts = SCENARIO.task.start_line.grid(SCENARIO.arm())
    requests = [
        ReachRequest(
            scenario=scenario,
            stream=stream,
            environment=environment,
            goal=goal,
            start=Start(start),
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
    a, b, c = request.start.x0
    twins = [request]
    for goal in ((math.nextafter(x, 1.0), y, z), (x, math.nextafter(y, 1.0), z), (x, y, 1e-300)):
        twins.append(replace(request, goal=np.array(goal)))
    for x0 in ((math.nextafter(a, 1.0), b, c), (a, 5e-324, c), (a, b, math.nextafter(c, 1.0))):
        twins.append(replace(request, start=Start(np.array(x0))))
    twins.append(replace(request, goal=request.start.x0, start=Start(request.goal)))
    assert len({twin.key for twin in twins}) == len(twins)


def test_joint_angles_count_where_the_arm_has_a_choice() -> None:
    request = reach_request(SCENARIO)
    start, (q,) = request.start, SCENARIO.arm().solve_ik(request.start.x0_R)
    assert replace(request, start=replace(start, q=q)).key == request.key
    assert replace(request, start=replace(start, q=q + 0.1)).key != request.key
    with pytest.raises(RequestError, match="planar-arm has 3 joint angles, the start has 2"):
        replace(request, start=replace(start, q=q[:2]))


@pytest.mark.parametrize("first_q", [None, np.full(7, 0.1)])
@pytest.mark.parametrize("second_q", [None, np.full(7, 0.2)])
def test_a_record_leads_back_to_prescribed_joint_angles(
    first_q: np.ndarray | None, second_q: np.ndarray | None
) -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    start = Start(
        np.array([0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.1, 0.15]), first_q
    )
    request = ReachRequest(scenario, "training", 3, np.array([0.7, 0.0, 1.0]), start)
    for asked in (request, request.then(replace(start, q=second_q))):
        record = replace(make_record(asked), q_start=tuple(range(7)))
        if asked.start.q is not None:
            record = replace(record, q_start=tuple(asked.start.q))
        assert ReachRequest.from_record(record, scenario) == asked
    nothing = ReachResult("invalid_start", ReachTrace(), "")
    assert ReachRequest.from_record(real_record(request, nothing, 0.0), scenario) == request
    keys = {replace(request, start=replace(start, q=q)).key for q in (None, np.full(7, 0.1))}
    assert len(keys) == 2


@pytest.mark.parametrize(
    "p_WG", [[np.nan, 0.0, 0.0], [0.5, np.inf, 0.0], [0.5, 0.0], [[0.5, 0.0, 0.0]]]
)
def test_goals_must_be_finite_points(p_WG: list[float]) -> None:
    with pytest.raises(RequestError, match="a goal is three finite numbers in metres, got"):
        check_goal(SCENARIO, np.array(p_WG))
    with pytest.raises(RequestError, match="a goal is three finite numbers in metres, got"):
        replace(reach_request(SCENARIO), goal=np.array(p_WG))


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
        scenario, records = library.scenario(), to_records(library.table().slice(0, 150))
        for record in records:
            request = ReachRequest.from_record(record, scenario)
            assert not np.any(request.start.b0) and request.start.q is None
            assert (request.key, request.after) == (record.key, ())


def test_a_base_or_an_earlier_reach_makes_another_key() -> None:
    request = reach_request(SCENARIO)

    def start(y_m: float = 0.0, x_m: float = 0.0, x0: np.ndarray = request.start.x0) -> Start:
        return Start(x0, np.array([x_m, y_m, 0.0]))

    second = request.then(start())
    twins = [
        request,
        *(replace(request, start=start(*b0)) for b0 in ((0.1,), (0.0, 0.1), (5e-324,))),
        second,
        second.then(start()),
        request.then(start(0.1)),
        replace(request, start=start(0.1)).then(start()),
        request.then(start(x0=request.start.x0 + [0.0, 0.0, 1e-15])),
        replace(request, start=Start(np.array([0.335, 0.1, 1.0]))).then(start()),
    ]
    assert len({twin.key for twin in twins}) == len(twins)
    assert all(len(twin.key) == 16 for twin in twins)
    assert replace(request, start=start(-0.0, -0.0)).key == request.key
