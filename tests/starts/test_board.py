from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.pr2_reaches import SCENARIO
from support.pr2_reference import link_poses

from lic_drake.errors import RequestError, ScenarioError
from lic_drake.kept import VARIABLE
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Starts
from lic_drake.starts import BoardStarts, board, board_starts, make_starts, training_starts

INSTANCE = SCENARIO.sample_instance("training", 0)
STILL = board_starts(SCENARIO, INSTANCE)
STAND = SCENARIO.task.stand
assert STAND is not None
STARTS = board_starts(SCENARIO, INSTANCE, moves=True)
BLOCKED = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 12}}")


def assert_points_in(starts: BoardStarts, rows: np.ndarray) -> None:
    """The tool, by kinematics that do not read the model, is in an open aperture, along x."""
    arm = starts.arm
    for start in starts.grid.take(rows):
        x0, b0, q = start.x0, start.b0, start.q
        assert q is not None
        X_WE = link_poses((b0[0], b0[1], 0.0), b0[2], q)[7]
        np.testing.assert_allclose(X_WE[:3, 3], x0[:3], atol=1e-9)
        np.testing.assert_allclose(X_WE[:3, 0], [1.0, 0.0, 0.0], atol=1e-9)
        assert np.min(np.linalg.norm(starts.p_WA - x0[:3], axis=1)) < 1e-9
        w, x, y, z = x0[3:]
        axis = [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]
        np.testing.assert_allclose(axis, [1.0, 0.0, 0.0], atol=1e-9)
        assert np.all((q >= arm.q_min - 1e-9) & (q <= arm.q_max + 1e-9))
        assert sum(region.holds(x0, b0) for region in starts.regions) == 1


def test_there_are_starts_in_the_centre_of_each_aperture_from_everywhere_in_range() -> None:
    assert len(STILL.grid) == 20
    np.testing.assert_allclose(STILL.grid.x0[:, :3], INSTANCE.p_WA)
    np.testing.assert_array_equal(STILL.grid.b0, np.tile([0.0, 0.0, 0.15], (20, 1)))
    assert 700 < len(STARTS.grid) <= 20 * 7 * 7
    low, high = STARTS.grid.b0.min(axis=0), STARTS.grid.b0.max(axis=0)
    np.testing.assert_allclose(low, [0.0, STAND.y_min_m, STAND.torso_min_m])
    np.testing.assert_allclose(high, [0.0, STAND.y_max_m, STAND.torso_max_m])
    assert_points_in(STARTS, np.arange(0, len(STARTS.grid), 40))


def test_no_other_configuration_without_contact_costs_less() -> None:
    arm, checker = STILL.arm, STILL.checker
    for start in STILL.grid.take(np.array([0, 7, 13])):
        assert start.q is not None and not checker.touches(start.b0, start.q)
        (others,) = arm.solve_pointing((start.x0[:3] - start.b0)[None], np.array([1.0, 0.0, 0.0]))
        cost = arm.kinematics.calc_preselection_cost(np.vstack([start.q, others]))
        cheaper = others[cost[1:] < cost[0] - 1e-12]
        assert all(checker.touches(start.b0, q) for q in cheaper)


def test_angles_are_those_of_the_grid_or_near_others_and_none_where_the_arm_cannot_be() -> None:
    for start in STARTS.grid.take(np.arange(0, len(STARTS.grid), 97)):
        q = STARTS.solve(start.x0, start.b0)
        assert q is not None and start.q is not None
        np.testing.assert_allclose(q, start.q, atol=1e-6)
        # The tool stands still while the arm moves about the line from shoulder to wrist.
        other = STARTS.arm.solve_ik(start.x0_R)[-1]
        q = STARTS.solve(start.x0, start.b0, near=other)
        assert STARTS.checker.touches(start.b0, other) or np.allclose(q, other, atol=1e-6)
    x0, b0 = STARTS.grid.x0[0], STARTS.grid.b0[0]
    assert STARTS.solve(x0, b0 + [0.0, 1.0, 0.0]) is None
    assert STARTS.solve(x0, b0 + [0.1, 0.0, 0.0]) is None
    assert STARTS.solve(x0, np.array([0.0, b0[1], 0.305 + 1e-4])) is None
    assert STARTS.solve(x0 + np.pad([0.01], (1, 5)), b0) is None
    aside = np.array([*x0[:3], *np.array([1.0, 0.0, 0.1, 0.0]) / np.sqrt(1.01)])
    assert STARTS.solve(aside, b0) is None


def test_blocked_apertures_have_no_start_and_no_arm_stands_in_what_blocks_them() -> None:
    instance = BLOCKED.sample_instance("training", 3)
    starts = make_starts(BLOCKED, instance)
    assert isinstance(starts, BoardStarts)
    assert len(starts.p_WA) == len(starts.regions) == 8
    assert len(starts.board.aperture_centres()) == 20
    here = [np.min(np.linalg.norm(starts.p_WA - x0[:3], axis=1)) < 1e-9 for x0 in STARTS.grid.x0]
    assert 0 < len(starts.grid) <= sum(here)
    for start in starts.grid.take(np.arange(0, len(starts.grid), 29)):
        assert start.q is not None and not starts.checker.touches(start.b0, start.q)


def test_the_lattice_fills_the_stand() -> None:
    values = np.where(STARTS.grid.b0[:, 1] > 0.0, 1.0, 0.5)
    values[np.isclose(STARTS.grid.x0[:, 2], 0.59)] = -np.inf  # The lowest row.
    lattice = STARTS.lattice(values)
    assert np.unique(lattice.x0[:, 2]).min() == pytest.approx(0.79)
    for p_WA in STARTS.p_WA[5:]:
        here = lattice.b0[np.all(np.isclose(lattice.x0[:, :3], p_WA), axis=1)]
        for axis in (1, 2):
            ends = STARTS.regions[0].b0_lower[axis], STARTS.regions[0].b0_upper[axis]
            steps = np.unique(here[:, axis])
            np.testing.assert_allclose(steps[[0, -1]], ends)
            assert np.diff(steps).max() <= 0.025 + 1e-6


def test_a_robot_that_moves_with_its_environment_starts_alike() -> None:
    """The translation T_b0 of Eq. (3)."""
    moved = board_starts(SCENARIO, INSTANCE, b0=np.array([0.0, -0.05, 0.15])).grid
    other = load_scenario(
        "sphere-aperture-clutter", "{clutter: {board_centre: [0.53, -0.24, 0.89]}}"
    )
    still = board_starts(other, other.sample_instance("training", 0)).grid
    np.testing.assert_allclose(moved.in_R, still.in_R, atol=1e-9)


def test_a_collection_tries_them_all_from_one_stand_an_environment() -> None:
    stands = set()
    for environment in range(9):
        tried = training_starts(SCENARIO, "training", environment)
        assert 19 <= len(tried) <= 20 and tried.q is None
        (b0,) = {tuple(row) for row in tried.b0.tolist()}
        assert b0[1:] == STAND.for_training(environment)
        stands.add(b0)
    assert len(stands) == 8


def test_what_has_no_such_starts_is_refused() -> None:
    with pytest.raises(ScenarioError, match="need an arm in space, as pr2, and a board"):
        board_starts(load_scenario("cylinder-aperture-clutter"), INSTANCE)
    with pytest.raises(ScenarioError, match="need an arm in space, as pr2, and a board"):
        board_starts(SCENARIO, replace(INSTANCE, p_WA=None))
    with pytest.raises(RequestError, match=r"there is no open aperture at y 2\.0 m"):
        STARTS.nearest_aperture(2.0, 0.9)


def test_starts_that_were_kept_are_the_same_and_damaged_ones_are_worked_out_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))

    def grid() -> Starts:
        board._preferred_before_bare_board.cache_clear()
        return board_starts(SCENARIO, INSTANCE, moves=True).grid

    def assert_as_ever(starts: Starts) -> None:
        for name in ("x0", "b0", "q"):
            np.testing.assert_array_equal(getattr(starts, name), getattr(STARTS.grid, name))

    assert_as_ever(grid())
    (path,) = tmp_path.iterdir()
    with monkeypatch.context() as patched:
        patched.setattr(board, "_preferred", lambda *args: pytest.fail("worked out again"))
        assert_as_ever(grid())
    np.savez(path, kept_as=path.name, x0=np.ones((2, 7)), b0=np.ones((3, 3)), q=np.ones((2, 7)))
    assert_as_ever(grid())
    assert "ignored the kept starts" in capsys.readouterr().err
    assert_as_ever(grid())
    assert capsys.readouterr().err == ""
