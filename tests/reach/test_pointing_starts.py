from dataclasses import replace

import numpy as np
import pytest
from support.pr2_reaches import SCENARIO
from support.pr2_reference import link_poses

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.reach.environment import Environment
from lic_drake.reach.pointing_starts import (
    PointingStarts,
    pointing_starts,
    standing_at,
)
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.starts import make_starts, training_starts
from lic_drake.scene.collision import CollisionChecker

INSTANCE = SCENARIO.sample_instance("training", 0)
STILL = pointing_starts(SCENARIO, INSTANCE)
BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 12}}")
STAND = SCENARIO.task.stand
assert STAND is not None


def apertures_of(instance: ClutterInstance) -> np.ndarray:
    assert instance.p_WA is not None
    return instance.p_WA


def assert_points_in(starts: PointingStarts, rows: np.ndarray) -> None:
    """The tool, by kinematics that do not read the model, is in an open aperture, along x."""
    grid = starts.grid
    for x0, b0, q in zip(grid.x0[rows], grid.b0[rows], starts.grid_angles[rows], strict=True):
        X_WE = link_poses((b0[0], b0[1], 0.0), b0[2], q)[7]
        np.testing.assert_allclose(X_WE[:3, 3], x0[:3], atol=1e-9)
        np.testing.assert_allclose(X_WE[:3, 0], [1.0, 0.0, 0.0], atol=1e-9)
        assert np.min(np.linalg.norm(starts.p_WA - x0[:3], axis=1)) < 1e-9
        w, x, y, z = x0[3:]
        axis = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        np.testing.assert_allclose(axis, [1.0, 0.0, 0.0], atol=1e-9)
        arm = SCENARIO.arm()
        assert np.all(q >= arm.q_min - 1e-9)
        assert np.all(q <= arm.q_max + 1e-9)


def test_a_robot_that_stays_has_a_start_in_the_centre_of_each_aperture() -> None:
    assert len(STILL.grid) == 20
    np.testing.assert_allclose(STILL.grid.x0[:, :3], apertures_of(INSTANCE))
    np.testing.assert_array_equal(STILL.grid.b0, np.tile([0.0, 0.0, 0.15], (20, 1)))
    assert_points_in(STILL, np.arange(20))


def test_a_robot_that_moves_has_them_from_everywhere_in_its_range() -> None:
    starts = make_starts(SCENARIO, INSTANCE)
    assert isinstance(starts, PointingStarts)
    assert 700 < len(starts.grid) <= 20 * 7 * 7
    low, high = starts.grid.b0.min(axis=0), starts.grid.b0.max(axis=0)
    np.testing.assert_allclose(low, [0.0, STAND.y_min_m, STAND.torso_min_m])
    np.testing.assert_allclose(high, [0.0, STAND.y_max_m, STAND.torso_max_m])
    assert_points_in(starts, np.arange(0, len(starts.grid), 40))


def test_a_reach_begins_with_the_preselected_configuration() -> None:
    short = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.04}}")
    conditions, angles = STILL.grid, STILL.grid_angles
    environment = Environment(short, INSTANCE)
    p_WG = SCENARIO.goals("training", 0)[4]
    for x0, q in zip(conditions.x0[::4], angles[::4], strict=True):
        result = environment.reach(p_WG, x0)
        assert result.outcome == "timeout", result.detail
        np.testing.assert_allclose(result.trace.q[0], q, atol=1e-6)


def test_no_other_configuration_without_contact_costs_less() -> None:
    arm = SCENARIO.arm()
    checker = CollisionChecker(arm, INSTANCE, SCENARIO.scene)
    for k in (0, 7, 13):
        b0, q = STILL.grid.b0[k], STILL.grid_angles[k]
        assert not checker.touches(b0, q)
        (others,) = arm.solve_pointing(STILL.grid.x0[k : k + 1, :3] - b0, np.array([1.0, 0.0, 0.0]))
        cost = arm.kinematics.calc_preselection_cost(others)
        least = arm.kinematics.calc_preselection_cost(q[None])[0]
        assert all(checker.touches(b0, row) for row in others[cost < least - 1e-12])


def test_angles_are_those_of_the_grid_and_none_where_the_robot_cannot_start() -> None:
    starts = make_starts(SCENARIO, INSTANCE)
    assert isinstance(starts, PointingStarts)
    grid = starts.grid
    for k in range(0, len(grid), 97):
        q = starts.angles(grid.x0[k], grid.p_WR[k], grid.torso_m[k])
        assert q is not None
        np.testing.assert_allclose(q, starts.grid_angles[k], atol=1e-6)
    x0, p_WR, torso_m = grid.x0[0], grid.p_WR[0], float(grid.torso_m[0])
    assert starts.angles(x0, p_WR + [0.0, 1.0], torso_m) is None
    assert starts.angles(x0, p_WR + [0.1, 0.0], torso_m) is None
    assert starts.angles(x0, p_WR, 0.305 + 1e-4) is None
    assert starts.angles(x0 + np.pad([0.01], (1, 5)), p_WR, torso_m) is None


def test_blocked_apertures_have_no_start_and_no_arm_stands_in_what_blocks_them() -> None:
    instance = BLOCKED.sample_instance("training", 3)
    starts = make_starts(BLOCKED, instance)
    assert isinstance(starts, PointingStarts)
    assert len(starts.p_WA) == 8
    assert len(starts.all_apertures) == 20
    assert starts.aperture_m == pytest.approx(0.2)
    whole = make_starts(SCENARIO, INSTANCE)
    here = [np.min(np.linalg.norm(starts.p_WA - x0[:3], axis=1)) < 1e-9 for x0 in whole.grid.x0]
    assert 0 < len(starts.grid) <= sum(here)
    for k in range(0, len(starts.grid), 29):
        assert not starts.checker.touches(starts.grid.b0[k], starts.grid_angles[k])


def test_a_robot_that_moves_with_its_environment_starts_alike() -> None:
    """The translation T_b0 of Eq. (3)."""
    moved = pointing_starts(SCENARIO, INSTANCE, standing_at(-0.05, 0.15)).grid
    other = load_scenario(
        "sphere-aperture-clutter", "{clutter: {board_centre: [0.53, -0.24, 0.89]}}"
    )
    still = pointing_starts(other, other.sample_instance("training", 0)).grid
    np.testing.assert_allclose(moved.in_R, still.in_R, atol=1e-9)


def test_a_collection_tries_them_all_from_one_stand_an_environment() -> None:
    stands = set()
    for environment in range(16):
        tried = training_starts(SCENARIO, "training", environment)
        assert 19 <= len(tried) <= 20
        (b0,) = {tuple(row) for row in tried.b0.tolist()}
        assert b0[1:] == STAND.for_training(environment)
        stands.add(b0)
    assert len(stands) == 8


def test_robots_and_environments_without_such_starts_are_refused() -> None:
    with pytest.raises(ScenarioError, match="need a robot in space and a board"):
        pointing_starts(load_scenario("cylinder-aperture-clutter"), INSTANCE)
    with pytest.raises(ScenarioError, match="need a robot in space and a board"):
        pointing_starts(SCENARIO, replace(INSTANCE, p_WA=None))
