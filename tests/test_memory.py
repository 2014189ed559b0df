"""Diagrams with Python systems die, and a process that simulates many reaches does not grow.

What keeps a diagram alive for ever in Drake 1.58: a Python system that holds a frame, body, joint,
another system's port, or an id object that a plant has returned.
"""

import gc
import os
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.reaches import free_space, reach_request, small_clutter
from support.worlds import box, cylinder, make_clutter

from lic_drake.control.mpc import HapticMpc
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach import sleeping
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession
from lic_drake.show.recording import Recording
from lic_drake.starts import board_starts

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/statm").exists(), reason="the memory is read from Linux's /proc"
)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list["weakref.ref[Any]"]:
    """Weak references to all diagrams, and their systems, that are built during a test."""
    references: list[weakref.ref[Any]] = []

    def make(*args: Any, **options: Any) -> ReachDiagram:
        reach_diagram = make_reach_diagram(*args, **options)
        systems = reach_diagram.diagram.GetSystems()
        references.extend(weakref.ref(item) for item in (reach_diagram.diagram, *systems))
        return reach_diagram

    monkeypatch.setattr(sleeping, "make_reach_diagram", make)
    return references


def alive(references: list["weakref.ref[Any]"]) -> list[str]:
    gc.collect()
    return sorted(item.get_name() for reference in references if (item := reference()) is not None)


ONE_DIAGRAM = ["controller", "plant", "reach", "scene_graph", "sensor", "standstill"]


@pytest.mark.parametrize("sleep", [True, False])
def test_a_session_keeps_a_limited_number_of_diagrams_and_drops_them_all_when_it_is_cleared(
    built: list["weakref.ref[Any]"], sleep: bool
) -> None:
    session = ReachSession(sleep)
    session.diagrams.size = 2
    gc.disable()  # The collector is not left to chance.
    try:
        for count in range(4):
            few = f"{{clutter: {{num_movable: 3, num_fixed: {count}}}}}"
            scenario = load_scenario("cylinder-clutter", few)
            session.run(reach_request(replace(scenario, stop=free_space(0.04).stop)))
        left = sum(reference() is not None for reference in built)
    finally:
        gc.enable()
    assert len(built) == 4 * len(ONE_DIAGRAM)
    assert left <= 2 * len(ONE_DIAGRAM)
    session.clear()
    assert alive(built) == []


def test_a_reach_in_contact_leaves_nothing(built: list["weakref.ref[Any]"]) -> None:
    scenario = free_space(1.0)
    wall = make_clutter(box(0.4, 0.0, (0.04, 0.8, 0.2)))
    within = Environment(scenario, wall)
    x0 = reach_request(scenario).start.x0
    _, trace, _ = within.reach(np.array([0.7, 0.0, 0.0]), x0)
    assert max(trace.contacts) > 0
    del within
    assert alive(built) == []
    assert len(built) == len(ONE_DIAGRAM)


def test_reaches_of_the_pr2_leave_nothing(built: list["weakref.ref[Any]"]) -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    session = ReachSession()
    for index in range(2):
        instance = scenario.sample_instance("training", index)
        starts = board_starts(scenario, instance).grid
        p_WG = scenario.goals("training", index)[4]
        session.run(ReachRequest(scenario, "training", index, p_WG, starts[7]))
    assert len(built) >= len(ONE_DIAGRAM)
    session.clear()
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
    session = ReachSession()
    outcomes = [session.run(request).outcome for request in requests]
    assert outcomes == ["diverged", "invalid_start", "unreachable"]
    session.clear()
    assert alive(built) == []


def test_a_recording_is_freed() -> None:
    recorded = Recording(free_space(0.2), make_clutter(cylinder(0.5, 0.3, movable=True)))
    diagram = weakref.ref(recorded._screen._diagram)
    del recorded
    gc.collect()
    assert diagram() is None


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
    session = ReachSession()
    growth = growth_mb(lambda i: session.run(requests[i]), 500, 5000)
    print(f"grew by {growth:.1f} MB")
    assert growth < 30.0


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["pr2", "iiwa14", "panda"])
def test_five_hundred_reaches_before_a_board_need_no_more_memory_than_250(
    robot: str,
) -> None:
    overrides = f"{{robot: {robot}, clutter: {{num_blocked: 10}}, stop: {{timeout_s: 2.0}}}}"
    scenario = load_scenario("sphere-aperture-clutter", overrides)
    requests = random_requests(scenario, "training", 100, 5)
    session = ReachSession()
    # By then the diagrams that are kept for 16 heights and numbers of objects are all there.
    growth = growth_mb(lambda i: session.run(requests[i]), 250, 500)
    print(f"grew by {growth:.1f} MB")
    assert growth < 15.0
