from dataclasses import replace

import numpy as np
from support.fake_reach import comparable
from support.reaches import free_space, reach_request, small_clutter

from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession
from lic_drake.reach.start import Start


def fresh(request: ReachRequest) -> ReachRecord:
    """The record of a process that has simulated nothing else."""
    return ReachSession().run(request)


def in_turn(requests: list[ReachRequest]) -> list[ReachRecord]:
    return list(map(ReachSession().run, requests))


def test_a_reach_does_not_know_who_used_its_diagram_before() -> None:
    request = reach_request(small_clutter(4.0))
    requests = [
        replace(
            request, environment=i, start=Start(request.start.x0, np.array([0.0, 0.02 * i, 0.0]))
        )
        for i in range(4)
    ]
    used = in_turn(requests)
    assert max(record.peak_contacts for record in used) > 0
    assert comparable(used) == comparable([fresh(request) for request in requests])


def test_the_pr2_stands_elsewhere_in_the_same_diagram() -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 2.0}}")
    requests = random_requests(scenario, "calibration", 2, 1)
    start = requests[1].start
    requests[1] = replace(requests[1], start=replace(start, b0=[*start.b0[:2], 0.2]))
    blocked = load_scenario(
        "sphere-aperture-clutter", "{clutter: {num_blocked: 10}, stop: {timeout_s: 2.0}}"
    )
    requests += random_requests(blocked, "calibration", 2, 1)
    used = in_turn(requests)
    assert max(record.peak_contacts for record in used) > 0
    assert comparable(used) == comparable([fresh(request) for request in requests])


def test_environments_with_the_same_movable_objects_share_a_diagram() -> None:
    session, request = ReachSession(), reach_request(small_clutter(0.04))
    for environment in range(5):
        session.run(replace(request, environment=environment))
    session.run(replace(request, start=Start(request.start.x0, np.array([0.0, 0.05, 0.0]))))
    session.run(request.then(request.start))
    assert len(session.diagrams) == 1
    session.run(reach_request(free_space(0.04)))
    assert len(session.diagrams) == 2
