from dataclasses import replace

import numpy as np
import pytest
from pr2_reaches import ARM, SCENARIO
from pr2_reference import link_poses

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RequestError, ScenarioError
from lic_drake.reach.environment import Environment
from lic_drake.reach.pointing_starts import PointingStarts, find_pointing_starts
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.starts import training_starts
from lic_drake.robots.pr2_inverse import calc_preselection_cost, solve_pointing
from lic_drake.scene.collision import CollisionChecker

INSTANCE = SCENARIO.sample_instance("training", 0)
STARTS = find_pointing_starts(SCENARIO, INSTANCE)


def apertures_of(instance: ClutterInstance) -> np.ndarray:
    assert instance.p_WA is not None
    return instance.p_WA


def test_the_tool_is_in_the_centre_of_its_aperture_and_points_in() -> None:
    assert len(STARTS.x0) == len(set(STARTS.aperture)) == 19
    for aperture, x0, q in zip(STARTS.aperture, STARTS.x0, STARTS.q, strict=True):
        X_WE = link_poses((0.0, 0.0, 0.0), SCENARIO.task.torso_m, q)[7]
        np.testing.assert_allclose(X_WE[:3, 3], apertures_of(INSTANCE)[aperture], atol=1e-9)
        np.testing.assert_allclose(X_WE[:3, 0], [1.0, 0.0, 0.0], atol=1e-9)
        np.testing.assert_allclose(x0[:3], X_WE[:3, 3], atol=1e-9)
        w, x, y, z = x0[3:]
        axis = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        np.testing.assert_allclose(axis, [1.0, 0.0, 0.0], atol=1e-9)
        assert np.all(q >= ARM.q_min - 1e-9)
        assert np.all(q <= ARM.q_max + 1e-9)


def test_a_reach_begins_with_the_preselected_configuration() -> None:
    short = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.04}}")
    environment = Environment(short, INSTANCE)
    p_WG = SCENARIO.goals("training", 0)[4]
    for x0, q in zip(STARTS.x0, STARTS.q, strict=True):
        result = environment.reach(p_WG, x0)
        assert result.outcome == "timeout", result.detail
        np.testing.assert_allclose(result.trace.q[0], q, atol=1e-6)


def test_no_other_configuration_without_contact_costs_less() -> None:
    checker = CollisionChecker(ARM, INSTANCE, SCENARIO.scene)
    for k in (0, 7, 13):
        assert not checker.touches(STARTS.q[k])
        p_RE = apertures_of(INSTANCE)[STARTS.aperture[k]]
        others = solve_pointing(ARM.kinematics, p_RE, np.array([1.0, 0.0, 0.0]))
        cost = calc_preselection_cost(ARM.kinematics, others)
        least = calc_preselection_cost(ARM.kinematics, STARTS.q[k][None])[0]
        assert all(checker.touches(q) for q in others[cost < least - 1e-12])


def test_blocked_apertures_have_no_start() -> None:
    blocked = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 16}}")
    instance = blocked.sample_instance("training", 3)
    starts = find_pointing_starts(blocked, instance)
    assert 1 <= len(starts.x0) <= 4
    np.testing.assert_allclose(starts.x0[:, :3], apertures_of(instance)[starts.aperture], atol=1e-9)


def test_a_robot_that_moves_with_its_environment_starts_alike() -> None:
    p_WR = np.array([0.2, -0.3])
    moved = find_pointing_starts(SCENARIO, INSTANCE.translated(np.append(p_WR, 0.0)), p_WR)
    np.testing.assert_allclose(moved.q, STARTS.q, atol=1e-6)
    shift = np.tile(np.append(p_WR, np.zeros(5)), (19, 1))
    np.testing.assert_allclose(moved.x0 - STARTS.x0, shift, atol=1e-9)


def test_another_torso_height_is_another_start_of_the_same_tool_position() -> None:
    raised = find_pointing_starts(SCENARIO, INSTANCE, torso_m=0.1)
    assert len(raised.x0) == 20
    assert raised.torso_m == 0.1
    np.testing.assert_allclose(raised.x0[:, :3], apertures_of(INSTANCE), atol=1e-9)
    X_WE = link_poses((0.0, 0.0, 0.0), 0.1, raised.q[3])[7]
    np.testing.assert_allclose(X_WE[:3, 3], apertures_of(INSTANCE)[3], atol=1e-9)


def test_rnd_draws_all_of_them_alike_but_for_those_that_failed() -> None:
    rng = np.random.default_rng(0)
    drawn = [STARTS.draw(rng) for _ in range(1900)]
    counts = np.bincount(drawn, minlength=19)
    assert counts.min() > 60  # 100 expected, standard deviation 9.7.
    assert counts.max() < 140
    failed = np.arange(18)
    assert {STARTS.draw(rng, failed) for _ in range(10)} == {18}
    with pytest.raises(RequestError, match="no aperture that has not been tried"):
        STARTS.draw(rng, np.arange(19))
    nothing = PointingStarts(
        aperture=np.zeros(0, dtype=np.intp),
        x0=np.zeros((0, 7)),
        q=np.zeros((0, 7)),
        p_WR=np.zeros(2),
        torso_m=0.15,
    )
    with pytest.raises(RequestError, match="no aperture"):
        nothing.draw(rng)


def test_a_collection_tries_them_all() -> None:
    x0, p_WR = training_starts(SCENARIO, "training", 0)
    np.testing.assert_array_equal(x0, STARTS.x0)
    np.testing.assert_array_equal(p_WR, np.zeros((19, 2)))


def test_robots_and_environments_without_such_starts_are_refused() -> None:
    with pytest.raises(ScenarioError, match="need the robot pr2 and apertures"):
        find_pointing_starts(load_scenario("cylinder-aperture-clutter"), INSTANCE)
    with pytest.raises(ScenarioError, match="need the robot pr2 and apertures"):
        find_pointing_starts(SCENARIO, replace(INSTANCE, p_WA=None))
