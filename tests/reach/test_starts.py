from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp
from support.kinematics import link_origins, only
from support.starts import APERTURES, ARM, LINE, aperture_starts, assert_possible, dense_scan
from support.worlds import gap_to_boxes

from lic_drake.errors import RequestError
from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.starts import (
    ApertureStarts,
    LineStarts,
    find_region,
    is_possible,
    make_starts,
    training_starts,
)
from lic_drake.reach.task import BaseTrack

SCENARIO = load_scenario("cylinder-aperture-clutter")
BARE = load_scenario(
    "cylinder-aperture-clutter",
    "{clutter: {num_movable: 0, num_fixed: 0}, stop: {timeout_s: 0.04}}",
)


def angles_of(conditions: Starts) -> list[np.ndarray]:
    q = [
        only(ARM.solve_ik(x0 - [*p_WR, 0.0]))
        for x0, p_WR in zip(conditions.x0, conditions.p_WR, strict=True)
    ]
    assert all(item is not None for item in q)
    return q


def assert_all_possible(starts: LineStarts | ApertureStarts, conditions: Starts) -> None:
    for x0, p_WR, q in zip(conditions.x0, conditions.p_WR, angles_of(conditions), strict=True):
        assert_possible(starts, Start(x0, np.array([*p_WR, 0.0]), q))
        assert is_possible(starts, x0, p_WR)
        region = find_region(starts.regions, x0, p_WR)
        assert np.all(x0 >= region.lower - 1e-6) and np.all(x0 <= region.upper + 1e-6)
        assert np.all(p_WR >= region.base_lower - 1e-6)
        assert np.all(p_WR <= region.base_upper + 1e-6)


# A fixed base


def test_starts_of_a_fixed_base_are_the_poses_of_the_line() -> None:
    for conditions, poses in ((LINE.grid, LINE.poses.grid), (LINE.lattice, LINE.poses.lattice)):
        np.testing.assert_array_equal(conditions.x0, poses)
        assert not np.any(conditions.p_WR)
        assert_all_possible(LINE, conditions)
    (region,) = LINE.regions
    np.testing.assert_array_equal(region.lower, LINE.poses.line.lower)
    np.testing.assert_array_equal(region.upper, LINE.poses.line.upper)
    assert not np.any([region.base_lower, region.base_upper])


@pytest.mark.parametrize("name", ["cylinder-clutter", "passage-clutter"])
def test_where_the_base_is_fixed_a_collection_tries_the_grid(name: str) -> None:
    scenario = load_scenario(name)
    starts = make_starts(scenario, scenario.sample_instance("training", 3))
    assert isinstance(starts, LineStarts)
    tried = training_starts(scenario, "training", 3)
    np.testing.assert_array_equal(tried.x0, scenario.task.start_line.grid(ARM))
    np.testing.assert_array_equal(tried.x0, starts.grid.x0)
    assert not np.any(tried.p_WR)


# Apertures


@settings(max_examples=20)
@given(
    # Apertures a micrometre apart are the same one to `find_region`.
    st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=4, unique_by=lambda y: round(y, 2)).filter(
        lambda y: len(y) < 2 or float(np.min(np.diff(np.sort(y)))) > 1e-4
    ),
    st.integers(0, 2**32 - 1),
)
def test_every_start_at_apertures_is_possible(y: list[float], seed: int) -> None:
    starts = aperture_starts(y)
    drawn = starts.draw(np.random.default_rng(seed), 3)
    for conditions in (starts.grid, drawn):
        assert_all_possible(starts, conditions)


def test_every_start_of_the_lattice_at_apertures_is_possible() -> None:
    assert len(APERTURES.lattice.x0) > 3 * 50
    assert_all_possible(APERTURES, APERTURES.lattice)


def test_grid_and_lattice_have_every_pose_at_every_aperture_that_the_track_allows() -> None:
    poses = APERTURES.poses
    for conditions, possible in (
        (APERTURES.grid, poses.grid),
        (APERTURES.lattice, poses.lattice),
    ):
        expected = {
            (round(p_WA[1], 9), round(p_WA[1] - y, 9), round(phi, 9))
            for p_WA in APERTURES.p_WA
            for _, y, phi in possible
            if -0.6 <= round(p_WA[1] - y, 9) <= 0.6
        }
        found = [
            (round(x0[1], 9), round(p_WR[1], 9), round(x0[2], 9))
            for x0, p_WR in zip(conditions.x0, conditions.p_WR, strict=True)
        ]
        assert len(found) == len(expected)
        assert set(found) == expected


def test_equal_bases_have_equal_numbers() -> None:
    # Two apertures a grid step apart: some bases serve both, and rounding must not split them.
    grid = aperture_starts([-0.2, -0.1, 0.1]).grid
    base = np.unique(grid.p_WR[:, 1])
    assert np.all(np.diff(base) > 0.05)


def test_the_arm_keeps_clear_of_the_barrier_at_every_start() -> None:
    for environment in range(3):
        instance = BARE.sample_instance("training", environment)
        starts = make_starts(BARE, instance)
        assert isinstance(starts, ApertureStarts)
        tried = starts.grid.join(training_starts(BARE, "training", environment))
        tried = tried.join(starts.lattice.take(np.arange(0, len(starts.lattice.x0), 7)))
        front = BARE.clutter.barrier_x_m - 0.5 * BARE.clutter.barrier_thickness_m
        for x0, p_WR, q in zip(tried.x0, tried.p_WR, angles_of(tried), strict=True):
            assert gap_to_boxes(q, instance.translated(-np.append(p_WR, 0.0))) > 0.005
            # Joints and hand are behind the barrier or, the hand, in the middle of its opening.
            x = link_origins(ARM, q)[:, 0] + p_WR[0]
            assert np.all(x[:3] < front)
            assert x[3] == pytest.approx(x0[0])


def test_drakes_own_check_finds_no_start_in_the_barrier() -> None:
    instance = BARE.sample_instance("training", 0)
    tried = training_starts(BARE, "training", 0)
    for x0, p_WR in zip(tried.x0[::3], tried.p_WR[::3], strict=True):
        base = np.append(p_WR, 0.0)
        environment = Environment(BARE, instance, b0=base)
        goal = base + [0.6, 0.0, 0.0]
        assert environment.reach(goal, x0).outcome == "timeout"
        # The same hand half an opening and half a hand's width aside stands in the barrier.
        assert environment.reach(goal, x0 + [0.0, 0.06, 0.0]).outcome == "invalid_start"


def test_the_same_number_of_starts_is_tried_at_each_aperture() -> None:
    for environment in range(5):
        tried = training_starts(SCENARIO, "training", environment)
        y, counts = np.unique(tried.x0[:, 1], return_counts=True)
        p_WA = SCENARIO.sample_instance("training", environment).p_WA
        assert p_WA is not None
        np.testing.assert_array_equal(y, np.sort(p_WA[:, 1]))
        assert counts.tolist() == [5, 5, 5]
        assert len(np.unique(np.hstack([tried.x0, tried.p_WR]), axis=0)) == 15


def test_tried_starts_are_functions_of_stream_and_environment() -> None:
    first = training_starts(SCENARIO, "training", 3)
    training_starts(SCENARIO, "training", 4)
    again = training_starts(load_scenario("cylinder-aperture-clutter"), "training", 3)
    np.testing.assert_array_equal(first.x0, again.x0)
    np.testing.assert_array_equal(first.p_WR, again.p_WR)
    for stream, environment in (("training", 4), ("holdout", 3)):
        other = training_starts(SCENARIO, stream, environment)
        assert not np.any(np.isin(first.x0[:, 2], other.x0[:, 2]))


def test_drawn_starts_are_uniform_among_the_possible_ones() -> None:
    starts = aperture_starts([0.1])
    drawn = starts.draw(np.random.default_rng(1), 1500)
    scan = dense_scan(starts)
    for a, b in ((drawn.x0[:, 2], scan.x0[:, 2]), (drawn.p_WR[:, 1], scan.p_WR[:, 1])):
        assert ks_2samp(a, b).pvalue > 1e-3
    assert (
        abs(
            np.corrcoef(drawn.x0[:, 2], drawn.p_WR[:, 1])[0, 1]
            - np.corrcoef(scan.x0[:, 2], scan.p_WR[:, 1])[0, 1]
        )
        < 0.1
    )


def test_an_aperture_out_of_the_tracks_reach_is_named() -> None:
    starts = aperture_starts([0.05, 0.58], track=BaseTrack(y_min_m=-0.6, y_max_m=0.1))
    with pytest.raises(RequestError, match=r"reaches the aperture at y = 0\.580 m from nowhere"):
        starts.draw(np.random.default_rng(0), 1)
    # The other one can be reached, and only that.
    assert set(starts.grid.x0[:, 1]) == {0.05}
    assert_all_possible(starts, starts.grid)


@pytest.mark.parametrize(
    ("x0", "p_WR"),
    [
        ([0.335, 0.1, 0.2], [0.0, 0.2]),  # Between two apertures.
        ([0.336, 0.05, 0.2], [0.001, 0.2]),  # Before an aperture.
        ([0.335, 0.05, 0.2], [0.001, 0.2]),  # The base beside its track.
        ([0.335, 0.52, 0.5], [0.0, 0.75]),  # The base beyond its track's end.
        ([0.335, 0.05, 0.9], [0.0, 0.1]),  # A hand turned too far for an aperture.
        ([0.335, 0.05, -0.7], [0.0, 0.0]),  # Beyond the joint limits.
    ],
)
def test_what_is_not_possible_at_apertures(x0: list[float], p_WR: list[float]) -> None:
    assert is_possible(APERTURES, np.array([0.335, 0.05, 0.2]), np.array([0.0, 0.2]))
    assert not is_possible(APERTURES, np.array(x0), np.array(p_WR))


def test_an_environment_without_apertures_has_the_starts_of_a_line() -> None:
    instance = replace(SCENARIO.sample_instance("training", 0), p_WA=None)
    assert isinstance(make_starts(SCENARIO, instance), LineStarts)


# Arrays of initial conditions


def test_conditions_are_taken_and_joined_row_by_row() -> None:
    grid = APERTURES.grid
    some = grid.take(np.array([3, 0])).join(grid.take(np.arange(len(grid.x0)) == 5))
    np.testing.assert_array_equal(some.x0, grid.x0[[3, 0, 5]])
    np.testing.assert_array_equal(some.p_WR, grid.p_WR[[3, 0, 5]])
    np.testing.assert_allclose(some.in_R[:, :2] + some.p_WR, some.x0[:, :2])
    np.testing.assert_array_equal(some.in_R[:, 2], some.x0[:, 2])
