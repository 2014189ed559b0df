"""Diagrams with Python systems die, and a process that simulates many reaches does not grow.

What keeps a diagram alive for ever in Drake 1.58: a Python system that holds a frame, body, joint,
another system's port, or an id object that a plant has returned.
"""

import gc
import os
import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.reaches import free_space, reach_request, small_clutter
from support.worlds import box, cylinder, make_clutter

from lic_drake.control.mpc import HapticMpc
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach import environment as reach_environment
from lic_drake.reach import rollout, simulation_pool
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.simulation_pool import SimulationPool
from lic_drake.reach.start import Start
from lic_drake.show import recording
from lic_drake.show.recording import Recording
from lic_drake.starts import board_starts

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="the memory is read from Linux's /proc"
)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> Iterator[list["weakref.ref[Any]"]]:
    """Weak references to all diagrams, and their systems, that are built during a test."""
    references: list[weakref.ref[Any]] = []

    def make(*args: Any, **options: Any) -> ReachDiagram:
        reach_diagram = make_reach_diagram(*args, **options)
        systems = reach_diagram.diagram.GetSystems()
        references.extend(weakref.ref(item) for item in (reach_diagram.diagram, *systems))
        return reach_diagram

    forget()
    for module in (reach_environment, recording, simulation_pool):
        monkeypatch.setattr(module, "make_reach_diagram", make)
    yield references
    forget()


def forget() -> None:
    """Drops the environments and the simulations of this process."""
    rollout._environments.clear()
    rollout._pool = SimulationPool()


def alive(references: list["weakref.ref[Any]"]) -> list[str]:
    gc.collect()
    return sorted(item.get_name() for reference in references if (item := reference()) is not None)


ONE_DIAGRAM = ["controller", "plant", "reach", "scene_graph", "sensor", "standstill"]


def test_environments_bases_and_histories_share_a_diagram(
    built: list["weakref.ref[Any]"],
) -> None:
    request = reach_request(small_clutter(0.04))
    for environment in range(5):
        run_reach(replace(request, environment=environment))
    run_reach(replace(request, start=Start(request.start.x0, np.array([0.0, 0.05, 0.0]))))
    run_reach(request.then(request.start))
    assert len(built) == len(ONE_DIAGRAM)
    assert alive(built) == ONE_DIAGRAM
    forget()
    assert alive(built) == []


def test_only_the_diagram_of_the_last_environment_stays_where_nothing_sleeps(
    built: list["weakref.ref[Any]"],
) -> None:
    for environment in range(3):
        run_reach(reach_request(small_clutter(0.04), environment=environment), sleep=False)
    assert len(built) == 3 * len(ONE_DIAGRAM)
    assert alive(built) == ONE_DIAGRAM


def test_a_pool_keeps_a_limited_number_of_diagrams(
    built: list["weakref.ref[Any]"], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulation_pool, "MAX_SIMULATIONS", 2)
    for count in range(5):
        scenario = load_scenario("cylinder-clutter", f"{{clutter: {{num_fixed: {count}}}}}")
        run_reach(reach_request(replace(scenario, stop=free_space(0.04).stop)))
    assert len(built) == 5 * len(ONE_DIAGRAM)
    assert len(alive(built)) <= 2 * len(ONE_DIAGRAM)


def test_a_reach_in_contact_leaves_nothing(built: list["weakref.ref[Any]"]) -> None:
    scenario = free_space(1.0)
    wall = make_clutter(box(0.4, 0.0, (0.04, 0.8, 0.2)))
    environment = Environment(scenario, wall)
    x0 = reach_request(scenario).start.x0
    _, trace, _ = environment.reach(np.array([0.7, 0.0, 0.0]), x0)
    assert max(trace.contacts) > 0
    del environment
    assert alive(built) == []
    assert len(built) == len(ONE_DIAGRAM)


def test_reaches_of_the_pr2_leave_nothing(built: list["weakref.ref[Any]"]) -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    for environment in range(2):
        instance = scenario.sample_instance("training", environment)
        starts = board_starts(scenario, instance).grid
        p_WG = scenario.goals("training", environment)[4]
        run_reach(ReachRequest(scenario, "training", environment, p_WG, starts[7]))
    assert len(built) >= 2 * len(ONE_DIAGRAM)
    forget()
    assert alive(built) == []


def test_failures_and_invalid_starts_leave_nothing(
    built: list["weakref.ref[Any]"], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise np.linalg.LinAlgError("no solution")

    monkeypatch.setattr(HapticMpc, "step", fail)
    requests = [
        reach_request(small_clutter(0.1), environment=0),
        reach_request(small_clutter(0.1), phi_deg=-90.0, environment=1),
        reach_request(small_clutter(0.1), (5.0, 0.0), environment=2),
    ]
    outcomes = [run_reach(request).outcome for request in requests]
    assert outcomes == ["diverged", "invalid_start", "unreachable"]
    forget()
    assert alive(built) == []


def test_a_recording_is_freed() -> None:
    recorded = Recording(free_space(0.2), make_clutter(cylinder(0.5, 0.3, movable=True)))
    diagram = weakref.ref(recorded._diagram)
    del recorded
    gc.collect()
    assert diagram() is None


def test_the_collector_is_not_left_to_chance(built: list["weakref.ref[Any]"]) -> None:
    gc.disable()
    try:
        for environment in range(3):
            run_reach(reach_request(small_clutter(0.04), environment=environment), sleep=False)
        left = [item for reference in built if (item := reference()) is not None]
        assert len(left) == len(ONE_DIAGRAM)
    finally:
        gc.enable()


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def growth_mb(reach: Callable[[int], Any], first: int, count: int) -> float:
    """Growth of the process from reach number `first` on, after the collector has run."""
    for i in range(count):
        if i == first:
            gc.collect()
            before = resident_mb()
        reach(i)
    gc.collect()
    return resident_mb() - before


@pytest.mark.slow
def test_five_thousand_reaches_need_no_more_memory_than_five_hundred() -> None:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.4}}")
    requests = random_requests(scenario, "training", 250, 20)
    growth = growth_mb(lambda i: run_reach(requests[i]), 500, 5000)
    print(f"grew by {growth:.1f} MB")
    assert growth < 30.0


@pytest.mark.slow
def test_three_hundred_reaches_of_the_pr2_need_no_more_memory_than_a_hundred() -> None:
    scenario = load_scenario(
        "sphere-aperture-clutter", "{clutter: {num_blocked: 10}, stop: {timeout_s: 2.0}}"
    )
    requests = random_requests(scenario, "training", 60, 5)
    growth = growth_mb(lambda i: run_reach(requests[i]), 100, 300)
    print(f"grew by {growth:.1f} MB")
    assert growth < 15.0
