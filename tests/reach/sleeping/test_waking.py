import numpy as np
import pytest
from support.fake_reach import comparable
from support.reaches import MEASURED, free_space, reach_request, start_angles
from support.worlds import box, cylinder, make_clutter

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.session import ReachSession
from lic_drake.reach.simulation import Cache, find_free
from lic_drake.reach.sleeping import monitors
from lic_drake.reach.sleeping.waking import SleepingObjects, World
from lic_drake.reach.trace import ReachResult

X0 = reach_request(free_space()).start.x0
P_WG = np.array([0.7, 0.0, 0.0])


def both(
    instance: ClutterInstance, timeout_s: float, p_WG: np.ndarray = P_WG
) -> tuple[ReachResult, ReachResult]:
    """The same reach with sleeping objects and with all of them awake."""
    scenario = free_space(timeout_s)
    return (
        Environment(scenario, instance).reach(p_WG, X0, keep_states=True),
        Environment(scenario, instance, sleep=False).reach(p_WG, X0, keep_states=True),
    )


def sleeping(scenario: Scenario, instance: ClutterInstance) -> SleepingObjects:
    return SleepingObjects(World(scenario, instance, 0.0, Cache(4)))


def row(x: float, count: int) -> ClutterInstance:
    """Cylinders one behind the other, 1 mm apart, in the way of the hand, and a few aside."""
    posts = [cylinder(x + 0.021 * i, -0.045, movable=True) for i in range(count)]
    aside = [cylinder(0.7, y, movable=True) for y in (-0.5, 0.5)]
    return make_clutter(*posts, cylinder(0.6, 0.4), *aside)


@pytest.mark.parametrize(
    "instance",
    [
        row(0.52, 1),
        # Only the first is touched by the arm; it pushes the others, which need more spares.
        row(0.52, 4),
        make_clutter(cylinder(0.52, -0.05, movable=True), box(0.62, 0.0, (0.02, 0.1, 0.2))),
    ],
)
def test_a_scene_moves_as_if_nothing_had_slept(instance: ClutterInstance) -> None:
    asleep, awake = both(instance, 8.0)
    first = instance.p_WO[instance.movable, :2]
    moved = np.linalg.norm(awake.trace.states[-1].p_WO - first, axis=1) > 1e-3
    assert np.any(moved)
    assert asleep.outcome == awake.outcome
    assert len(asleep.trace.states) == len(awake.trace.states)
    for name in ("q", "v", "p_WO", "v_WO"):
        a, b = (
            np.array([getattr(state, name) for state in result.trace.states])
            for result in (asleep, awake)
        )
        # The solver adds in another order, so the last digits may differ.
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9)
    # What nothing came near has not moved at all.
    np.testing.assert_array_equal(asleep.trace.states[-1].p_WO[~moved], first[~moved])


def test_no_sleeper_takes_part_in_the_dynamics() -> None:
    scenario = free_space(1.0)
    crowd = load_scenario("cylinder-clutter").sample_instance("calibration", 1)
    simulation = sleeping(scenario, crowd)
    simulation.begin(start_angles(scenario), P_WG)
    assert simulation.state().p_WO.shape == (40, 2)
    assert simulation._now.num_movable < 5


def test_a_sleeper_is_in_the_way_of_a_start() -> None:
    scenario = free_space()
    q = start_angles(scenario)
    elsewhere = q + [0.3, 0.0, 0.0]
    tip = scenario.arm().calc_pose(elsewhere).p_RE
    simulation = sleeping(scenario, make_clutter(cylinder(*tip[:2], movable=True)))
    np.testing.assert_array_equal(find_free(simulation, np.array([elsewhere, q]), P_WG), q)
    assert find_free(simulation, elsewhere[None], P_WG) is None


def test_waking_up_changes_neither_places_nor_speeds() -> None:
    scenario = free_space(10.0)
    simulation = sleeping(scenario, row(0.52, 4))
    simulation.begin(start_angles(scenario), P_WG)
    spares = set()
    for step in range(200):
        simulation.advance_to(step * scenario.mpc.period_s)
        before = simulation.state()
        simulation.wake_near(simulation.joint_angles())
        for a, b in zip(before, simulation.state(), strict=True):
            np.testing.assert_array_equal(a, b)
        spares.add(simulation._now.num_movable)
    assert spares >= {2, 4}


def test_what_was_pushed_away_leaves_no_ghost() -> None:
    # The hand pushes the cylinder along and passes where it stood.
    instance = make_clutter(cylinder(0.52, -0.045, movable=True))
    scenario = free_space(12.0)
    _, trace, _ = Environment(scenario, instance).reach(P_WG, X0, keep_states=True)
    assert trace.p_WE[-1][0] > 0.55
    assert np.linalg.norm(trace.states[-1].p_WO[0] - [0.52, -0.045]) > 0.02


def test_the_next_reach_finds_everything_in_its_place() -> None:
    scenario = free_space(6.0)
    environment = Environment(scenario, row(0.52, 4))
    results = [environment.reach(P_WG, X0, keep_states=True) for _ in range(2)]
    for a, b in zip(results[0].trace.states, results[1].trace.states, strict=True):
        for mine, theirs in zip(a, b, strict=True):
            np.testing.assert_array_equal(mine, theirs)


def test_where_waking_up_came_too_late_all_are_awake(monkeypatch: pytest.MonkeyPatch) -> None:
    _, awake = both(row(0.52, 2), 3.0)
    monkeypatch.setattr(monitors, "MAX_MOVE_M", 1e-4)
    asleep, _ = both(row(0.52, 2), 3.0)
    assert asleep.outcome == awake.outcome
    np.testing.assert_array_equal(asleep.trace.q, awake.trace.q)


@pytest.mark.slow
def test_records_of_300_reaches_are_the_same_with_and_without_sleep() -> None:
    requests = random_requests(load_scenario("cylinder-clutter"), "calibration", 60, 5)
    asleep, awake = (list(map(ReachSession(on).run, requests)) for on in (True, False))
    assert sum(a.outcome != b.outcome for a, b in zip(asleep, awake, strict=True)) <= 3
    same = [
        all(getattr(a, m) == pytest.approx(getattr(b, m), abs=1e-6, nan_ok=True) for m in MEASURED)
        for a, b in zip(asleep, awake, strict=True)
    ]
    # Contact is chaotic: now and then, a difference in the last digit grows.
    assert np.mean(same) > 0.9


def test_a_sleeping_record_is_the_same_again() -> None:
    requests = random_requests(load_scenario("cylinder-clutter"), "calibration", 1, 3)
    once = list(map(ReachSession().run, requests))
    again = list(map(ReachSession().run, reversed(requests)))
    assert comparable(once) == comparable(again[::-1])
