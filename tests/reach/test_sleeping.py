"""Reaches in which objects sleep, and diagrams that environments share."""

from dataclasses import replace

import numpy as np
import pytest
from support.fake_reach import comparable
from support.reaches import free_space, reach_request, small_clutter, start_angles
from support.worlds import box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach import sleeping
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.environment import Environment
from lic_drake.reach.rig import Rig
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession
from lic_drake.reach.simulation import Cache
from lic_drake.reach.sleeping import SleepingObjects, World, set_fixed_objects
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult

X0 = reach_request(free_space()).start.x0
P_WG = np.array([0.7, 0.0, 0.0])


def both(instance: ClutterInstance, timeout_s: float) -> tuple[ReachResult, ReachResult]:
    """The same reach with sleeping objects and with all of them awake."""
    scenario = free_space(timeout_s)
    return (
        Environment(scenario, instance).reach(P_WG, X0, keep_states=True),
        Environment(scenario, instance, sleep=False).reach(P_WG, X0, keep_states=True),
    )


def row(x: float, count: int) -> ClutterInstance:
    """Cylinders one behind the other, 1 mm apart, in the way of the hand, and a few aside."""
    posts = [cylinder(x + 0.021 * i, -0.045, movable=True) for i in range(count)]
    aside = [cylinder(0.7, y, movable=True) for y in (-0.5, 0.5)]
    return make_clutter(*posts, cylinder(0.6, 0.4), *aside)


@pytest.mark.parametrize(
    "instance",
    [
        # Only the first is touched by the arm; it pushes the others, which need more spares.
        row(0.52, 4),
        make_clutter(cylinder(0.52, -0.05, movable=True), box(0.62, 0.0, (0.02, 0.1, 0.2))),
    ],
)
def test_a_scene_moves_as_if_nothing_had_slept(instance: ClutterInstance) -> None:
    asleep, awake = both(instance, 6.0)
    first = instance.p_WO[instance.movable, :2]
    moved = np.linalg.norm(awake.trace.states[-1].q_clutter - first, axis=1) > 1e-3
    assert np.any(moved)
    assert asleep.outcome == awake.outcome
    for pair in zip(asleep.trace.states, awake.trace.states, strict=True):
        a, b = (np.concatenate([values.ravel() for values in state]) for state in pair)
        # The solver adds in another order, so the last digits may differ.
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9)
    # What nothing came near has not moved at all.
    np.testing.assert_array_equal(asleep.trace.states[-1].q_clutter[~moved], first[~moved])


def test_a_sleeper_is_in_the_way_of_a_start() -> None:
    tip = X0 + [0.1, 0.0, 0.0]
    nothing = make_clutter(cylinder(0.9, 0.5, movable=True))
    crowded = make_clutter(cylinder(*tip[:2], movable=True))
    for instance, outcome in ((nothing, "timeout"), (crowded, "invalid_start")):
        assert Environment(free_space(0.1), instance).reach(P_WG, tip).outcome == outcome


def test_waking_up_changes_neither_places_nor_speeds() -> None:
    scenario = free_space(10.0)
    simulation = SleepingObjects(World(scenario, row(0.52, 4), 0.0, Cache(4)))
    simulation.begin(start_angles(scenario), P_WG)
    spares = set()
    for step in range(200):
        simulation.advance_to(step * scenario.mpc.period_s)
        before = simulation.state()
        simulation.wake_near(simulation.joint_angles())
        for a, b in zip(before, simulation.state(), strict=True):
            np.testing.assert_array_equal(a, b)
        spares.add(len(simulation._rig.q_clutter_first))
    # Of six movable objects.
    assert spares == {0, 2, 4}


def test_what_was_pushed_away_leaves_no_ghost() -> None:
    # The hand pushes the cylinder along and passes where it stood.
    instance = make_clutter(cylinder(0.52, -0.045, movable=True))
    _, trace, _ = Environment(free_space(12.0), instance).reach(P_WG, X0)
    assert trace.p_WE[-1][0] > 0.55
    assert trace.q_clutter is not None
    assert np.linalg.norm(trace.q_clutter[0] - [0.52, -0.045]) > 0.02


def test_where_waking_up_came_too_late_all_are_awake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sleeping, "MAX_MOVE_M", 1e-4)
    asleep, awake = both(row(0.52, 2), 3.0)
    assert asleep.outcome == awake.outcome
    np.testing.assert_array_equal(asleep.trace.q, awake.trace.q)


# Diagrams that environments share


def test_the_pr2_stands_elsewhere_in_the_same_diagram() -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 1.0}}")
    requests = random_requests(scenario, "calibration", 2, 1)
    start = requests[1].start
    requests[1] = replace(requests[1], start=replace(start, b0=[*start.b0[:2], 0.2]))
    more = replace(scenario, clutter=replace(scenario.clutter, num_blocked=10))
    requests += random_requests(more, "calibration", 1, 1)
    used = list(map(ReachSession().run, requests))
    assert max(record.peak_contacts for record in used) > 0
    fresh = [ReachSession().run(request) for request in requests[1:]]
    assert comparable(used[1:]) == comparable(fresh)


def test_environments_with_the_same_movable_objects_share_a_diagram() -> None:
    session, request = ReachSession(), reach_request(small_clutter(0.04))
    for environment in range(5):
        session.run(replace(request, environment=environment))
    session.run(replace(request, start=Start(request.start.x0, np.array([0.0, 0.05, 0.0]))))
    session.run(request.then(request.start))
    assert len(session.diagrams) == 1
    session.run(reach_request(free_space(0.04)))
    assert len(session.diagrams) == 2


@pytest.mark.parametrize("place", ["make_reach_diagram", "set_fixed_objects"])
def test_an_interrupted_beginning_spoils_no_later_reach(
    place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, request = ReachSession(), reach_request(small_clutter(0.4))
    requests = [replace(request, environment=environment) for environment in range(2)]
    whole = getattr(sleeping, place)

    def stop_early(*arguments: object) -> object:
        whole(*arguments)
        raise KeyboardInterrupt

    if place == "set_fixed_objects":
        session.run(requests[0])
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(sleeping, place, stop_early)
        session.run(requests[1])
    fresh = [ReachSession().run(request) for request in requests]
    assert comparable(list(map(session.run, requests))) == comparable(fresh)


SCENARIO = load_scenario("cylinder-clutter")
HERE = make_clutter(cylinder(0.6, 0.3), box(0.5, -0.6, (0.3, 0.1, 0.2)), cylinder(0.3, 0.5))
THERE = make_clutter(box(0.35, 0.2, (0.2, 0.2, 0.2)), cylinder(0.2, -0.4), cylinder(0.7, 0.0))
OVERLAPPING = make_clutter(*(box(0.3, 0.02 * i, (0.1, 0.1, 0.1)) for i in range(3)))


def forces(made: ReachDiagram, furniture: ClutterInstance | None = None) -> np.ndarray:
    """The sum of the taxel forces in random configurations, N."""
    rig = Rig(made)
    if furniture is not None:
        set_fixed_objects(rig, furniture)
    arm, rng = SCENARIO.arm(), np.random.default_rng(1)
    total = []
    for q in rng.uniform(arm.q_min, arm.q_max, (60, 3)):
        made.set_start(rig.context, q, np.zeros(3))
        total.append(np.sum(rig.taxel_force()))
    return np.array(total)


def test_contacts_are_those_of_a_scene_that_was_built_so() -> None:
    here = make_reach_diagram(SCENARIO, HERE)
    expected = forces(make_reach_diagram(SCENARIO, THERE))
    assert np.count_nonzero(expected) > 5
    np.testing.assert_array_equal(forces(here, THERE), expected)
    assert not np.array_equal(forces(here), expected)  # Other contexts stay as they are.
    # Objects that are welded together are no contacts, which Drake's solver would not accept.
    rig = Rig(here)
    set_fixed_objects(rig, OVERLAPPING)
    results = rig.plant.get_contact_results_output_port().Eval(rig.plant_context)
    assert results.num_hydroelastic_contacts() == 0
