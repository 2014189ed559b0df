"""Reaches of the PR2: in free space, against a fixed sphere, and into 40 floating ones."""

import numpy as np
import pytest
from support.fake_reach import comparable
from support.pr2_reaches import ARM, SCENARIO, spheres

from lic_drake.errors import RequestError
from lic_drake.experience.collect import CollectionRequest
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.rig import Rig
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import ReachSession, run_reach
from lic_drake.reach.simulation import Simulation, simulate
from lic_drake.reach.start import Start
from lic_drake.reach.trace import ReachResult
from lic_drake.robots.pr2 import Q_HOME
from lic_drake.starts import board_starts

PRECISE = load_scenario("sphere-aperture-clutter", "{stop: {success_distance_m: 0.01}}")
FREE = Environment(PRECISE, spheres())
BRIEF = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.6}}")


def reach_freely(p_WG: np.ndarray, q: np.ndarray = Q_HOME) -> ReachResult:
    return FREE.reach(p_WG, ARM.tip_pose(q) + np.pad(FREE.b0, (0, 4)))


@pytest.mark.parametrize(
    "p_WG", [(0.75, -0.2, 1.0), (0.6, -0.6, 0.8), (0.5, 0.1, 1.2), (0.7, -0.3, 0.6)]
)
def test_in_free_space_the_tool_comes_within_a_centimetre(p_WG: tuple[float, ...]) -> None:
    result = reach_freely(np.array(p_WG))
    assert result.outcome == "reached"
    assert np.linalg.norm(result.trace.p_WE[-1] - p_WG) < 0.01
    assert max(result.trace.peak_force) == 0.0
    assert result.trace.time_s[-1] < 15.0
    for q in result.trace.q:
        assert np.all(q >= ARM.q_min - 0.02)
        assert np.all(q <= ARM.q_max + 0.02)


@pytest.mark.slow
def test_nearly_all_goals_that_the_arm_can_reach_are_reached_in_free_space() -> None:
    rng = np.random.default_rng(0)
    count = reached = 0
    while count < 100:
        goal = ARM.calc_pose(rng.uniform(ARM.q_min, ARM.q_max)).p_RE + FREE.b0
        if goal[0] > 0.45 and 0.5 < goal[2] < 1.5:
            count += 1
            reached += reach_freely(goal).outcome == "reached"
    assert reached >= 0.95 * count


def test_a_forearm_turns_on_beyond_half_a_turn() -> None:
    q = Q_HOME.copy()
    q[[4, 5]] = 3.1, -1.6
    beyond = q.copy()
    beyond[4] += 1.2
    simulation = Simulation(Rig(make_reach_diagram(PRECISE, spheres())))
    result = simulate(simulation, PRECISE, q, ARM.calc_pose(beyond).p_RE)
    assert result.outcome == "reached"
    rolls = np.array(result.trace.q)[:, 4]
    assert rolls[0] == 3.1
    assert rolls.max() > np.pi + 0.05
    assert np.max(np.abs(np.diff(rolls))) < 0.05


def test_against_a_fixed_sphere_the_force_settles_at_the_threshold() -> None:
    x0 = ARM.tip_pose(Q_HOME) + np.pad([SCENARIO.task.torso_m], (2, 4))
    p_WE, u_W = x0[:3], ARM.calc_pose(Q_HOME).R_RE[:, 0]
    # Its surface is 5 cm before the fingertips, which end 8.5 mm beyond the tool frame. With the
    # goal in its middle there is no way past it.
    centre = p_WE + (0.0085 + 0.05 + 0.05) * u_W
    result = Environment(SCENARIO, spheres(centre)).reach(centre, x0)
    assert result.outcome == "stuck"
    np.testing.assert_allclose(result.trace.peak_force[-25:], 3.0, rtol=0.2)


def test_a_reach_into_forty_spheres_gives_the_same_record_again() -> None:
    instance = BRIEF.sample_instance("training", 1)
    start = board_starts(BRIEF, instance, b0=np.array([0.0, 0.02, 0.16]))
    # Base and tool 1 cm nearer to the spheres than starts are: a request may be of any base.
    p_WR, x0 = np.array([0.01, 0.02]), start.grid.x0[8] + np.eye(7)[0] * 0.01
    p_WG = BRIEF.goals("training", 1)[6]
    request = ReachRequest(BRIEF, "training", 1, p_WG, Start(x0, np.array([*p_WR, 0.16])))
    record = run_reach(request)
    assert record.outcome == "timeout"
    assert record.robot == "pr2"
    assert (record.base_x, record.base_y, record.torso) == (0.01, 0.02, 0.16)
    assert record.in_space
    np.testing.assert_array_equal(record.start.x0, x0)
    np.testing.assert_allclose(record.q_start, start.grid.q[8], atol=1e-6)
    final = ARM.tip_pose(np.array(record.q_final)) + np.pad([*p_WR, 0.16], (0, 4))
    names = ("x", "y", "z", "qw", "qx", "qy", "qz")
    np.testing.assert_allclose([getattr(record, f"final_{n}") for n in names], final, atol=1e-12)
    assert record.min_distance < np.linalg.norm(p_WG - x0[:3])
    assert ReachRequest.from_record(record, BRIEF) == request
    assert ReachRequest.from_record(record, BRIEF).key == record.key
    assert comparable([ReachSession().run(request)]) == comparable([record])
    lone = ReachSession(sleep=False).run(request)
    assert lone.outcome == record.outcome
    np.testing.assert_allclose(lone.q_final, record.q_final, atol=1e-3)


def test_a_start_of_the_wrong_kind_is_refused() -> None:
    p_WG = BRIEF.goals("training", 1)[6]
    with pytest.raises(RequestError, match=r"a start of pr2 has 7 numbers \(x, y, z, qw"):
        ReachRequest(BRIEF, "training", 1, p_WG, Start(np.zeros(3)))


def test_a_collection_holds_every_goal_from_every_start() -> None:
    # From (y 0.075 m, torso 0.2 m), where environment 7 has them, the arm cannot take one start.
    for environment, count, y_m, torso_m in ((0, 20, -0.075, 0.1), (7, 19, 0.075, 0.2)):
        collection = CollectionRequest(
            scenario=BRIEF, environments=1, first_environment=environment
        )
        requests = collection.reaches(environment)
        assert len({request.key for request in requests}) == len(requests) == 12 * count
        assert {tuple(request.start.b0) for request in requests} == {(0.0, y_m, torso_m)}
        assert len({tuple(request.goal) for request in requests}) == 12
        assert len({tuple(request.start.x0[:3]) for request in requests}) == count


def test_a_further_reach_finds_the_spheres_where_the_first_left_them() -> None:
    p_WG = BRIEF.goals("training", 2)[4]
    starts = board_starts(BRIEF, BRIEF.sample_instance("training", 2)).grid.without_q()
    first = ReachRequest(BRIEF, "training", 2, p_WG, starts[7])
    second = first.then(Start(starts.x0[8], np.array([0.0, 0.0, 0.16])))
    assert (second.start.b0[2], second.after[0].b0[2]) == (0.16, 0.15)
    record = run_reach(second)
    assert len(record.after) == 7 + 2 + 1
    assert ReachRequest.from_record(record, BRIEF) == second
    assert second.before() == first
    assert second.key != first.then(starts[8]).key
