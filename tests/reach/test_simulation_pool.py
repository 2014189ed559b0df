from dataclasses import replace

import numpy as np
import pytest
from support.fake_reach import comparable
from support.reaches import free_space, reach_request, small_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach import rollout
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.simulation_pool import SimulationPool
from lic_drake.reach.start import Start
from lic_drake.scene.sleep import put_to_sleep


def fresh(request: ReachRequest) -> ReachRecord:
    """The record of a process that has simulated nothing else."""
    rollout._environments.clear()
    rollout._pool = SimulationPool()
    return run_reach(request)


def in_turn(requests: list[ReachRequest]) -> list[ReachRecord]:
    rollout._environments.clear()
    rollout._pool = SimulationPool()
    return [run_reach(request) for request in requests]


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


def sleeping(environment: int, spares: int = 2) -> ClutterInstance:
    return put_to_sleep(small_clutter().sample_instance("training", environment), spares)


@pytest.mark.parametrize(
    ("instance", "same"),
    [
        (sleeping(1), True),
        (sleeping(0, spares=4), False),
        (replace(sleeping(0), mass=np.full(8, 0.3)), False),
        (sleeping(0).subset(np.r_[1:8]), False),
    ],
)
def test_what_a_diagram_can_be_used_for(instance: ClutterInstance, same: bool) -> None:
    scenario, pool = free_space(), SimulationPool()
    first = pool.get(scenario, sleeping(0), None)
    assert (pool.get(scenario, instance, None) is first) == same
    assert pool.get(free_space(1.0), sleeping(0), None) is not first
