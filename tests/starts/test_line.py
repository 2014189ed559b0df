from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp
from support.starts import APERTURES, ARM, LINE, aperture_starts, assert_feasible, dense_scan
from support.worlds import gap_to_boxes

from lic_drake.errors import RequestError
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.task import BaseTrack
from lic_drake.starts import LineStarts, Region, find_regions, make_starts, training_starts

SCENARIO = load_scenario("cylinder-aperture-clutter")
NONE = np.zeros(0)
BOTH = pytest.mark.parametrize("starts", [LINE, APERTURES], ids=["line", "apertures"])


def assert_all_feasible(starts: LineStarts, some: Starts) -> None:
    for start in some:
        q = starts.solve(start.x0, start.b0)
        assert q is not None
        assert start.q is None or np.allclose(start.q, q, atol=1e-9)
        assert_feasible(starts, replace(start, q=q))
        assert sum(region.holds(start.x0, start.b0) for region in starts.regions) == 1


@BOTH
def test_every_start_of_grid_and_lattice_is_feasible(starts: LineStarts) -> None:
    assert len(starts.lattice(NONE)) > len(starts.grid) > 15
    assert_all_feasible(starts, starts.grid)
    assert_all_feasible(starts, starts.lattice(NONE))


def test_the_papers_line_has_21_starts_from_a_base_that_stays() -> None:
    assert len(LINE.grid) == 21
    assert not np.any(LINE.grid.b0)
    (region,) = LINE.regions
    np.testing.assert_array_equal([region.lower, region.upper], [LINE.line.lower, LINE.line.upper])
    assert not np.any([region.b0_lower, region.b0_upper])


@BOTH
def test_the_whole_arm_is_behind_the_start_line(starts: LineStarts) -> None:
    for start in starts.lattice(NONE):
        assert start.q is not None
        pose = ARM.calc_pose(start.q)
        x = np.append(pose.p_RL[:, 0], pose.p_RE[0]) + start.b0[0]
        assert x.max() <= start.x0[0] + 1e-9


def test_at_apertures_every_pose_of_the_line_is_there_that_the_track_allows() -> None:
    line = replace(APERTURES, track=None, p_WA=None)
    for some, poses in ((APERTURES.grid, line.grid), (APERTURES.lattice(NONE), line.lattice(NONE))):
        expected = {
            (round(p_WA[1], 9), round(p_WA[1] - y, 9), round(phi, 9))
            for p_WA in APERTURES.p_WA
            for _, y, phi in poses.x0
            if abs(round(p_WA[1] - y, 9)) <= APERTURES.track.y_max_m
        }
        found = [tuple(np.round([s.x0[1], s.b0[1], s.x0[2]], 9)) for s in some]
        assert len(found) == len(expected)
        assert set(found) == expected


@settings(max_examples=15, deadline=None)
@given(
    # Apertures a micrometre apart would be the same one.
    st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=4, unique_by=lambda y: round(y, 2)).filter(
        lambda y: len(y) < 2 or float(np.min(np.diff(np.sort(y)))) > 1e-4
    ),
    st.integers(0, 2**32 - 1),
)
def test_drawn_starts_are_feasible(y: list[float], seed: int) -> None:
    starts = aperture_starts(y)
    assert_all_feasible(starts, starts.draw(np.random.default_rng(seed), 3))


def test_drawn_starts_are_uniform_among_the_feasible_ones() -> None:
    starts = aperture_starts([0.1])
    drawn, scan = starts.draw(np.random.default_rng(1), 1500), dense_scan(starts)
    for a, b in ((drawn.x0[:, 2], scan.x0[:, 2]), (drawn.b0[:, 1], scan.b0[:, 1])):
        assert ks_2samp(a, b).pvalue > 1e-3


def test_no_start_touches_the_barrier() -> None:
    for environment in range(3):
        instance = SCENARIO.sample_instance("training", environment)
        starts = make_starts(SCENARIO, instance)
        tried = starts.grid.join(starts.lattice(NONE).take(np.arange(0, 500, 7)))
        front = SCENARIO.clutter.barrier_x_m - 0.5 * SCENARIO.clutter.barrier_thickness_m
        bare = instance.subset(np.flatnonzero([shape == "box" for shape in instance.shape]))
        for start in tried:
            assert start.q is not None
            assert gap_to_boxes(start.q, bare.translated(-start.b0)) > 0.005
            # Joints and hand are behind the barrier or, the hand, in the middle of its opening.
            assert np.all(ARM.calc_pose(start.q).p_RL[:, 0] + start.b0[0] < front)


@pytest.mark.parametrize("name", ["cylinder-clutter", "passage-clutter"])
def test_where_the_base_is_fixed_a_collection_tries_the_grid(name: str) -> None:
    scenario = load_scenario(name)
    tried = training_starts(scenario, "training", 3)
    np.testing.assert_array_equal(tried.x0, scenario.task.start_line.grid(ARM))
    assert tried.q is None and not np.any(tried.b0)


def test_the_same_number_of_starts_is_tried_at_each_aperture() -> None:
    tried = training_starts(SCENARIO, "training", 3)
    y, counts = np.unique(tried.x0[:, 1], return_counts=True)
    p_WA = SCENARIO.sample_instance("training", 3).p_WA
    assert p_WA is not None
    np.testing.assert_array_equal(y, np.sort(p_WA[:, 1]))
    assert counts.tolist() == [3, 3, 3, 3, 3]
    assert len(np.unique(np.hstack([tried.x0, tried.b0]), axis=0)) == 15
    # They are a function of stream and environment.
    again = training_starts(load_scenario("cylinder-aperture-clutter"), "training", 3)
    np.testing.assert_array_equal(tried.x0, again.x0)
    np.testing.assert_array_equal(tried.b0, again.b0)


def test_an_aperture_out_of_the_tracks_reach_is_named() -> None:
    starts = aperture_starts([0.05, 0.58], track=BaseTrack(y_min_m=-0.6, y_max_m=0.1))
    with pytest.raises(RequestError, match=r"reaches the aperture at y = 0\.580 m from nowhere"):
        starts.draw(np.random.default_rng(0), 1)
    # The other one can be reached, and only that.
    assert set(starts.grid.x0[:, 1]) == {0.05}


@pytest.mark.parametrize(
    ("starts", "x0", "b0"),
    [
        (APERTURES, [0.335, 0.1, 0.2], [0.0, 0.2, 0.0]),  # Between two apertures.
        (APERTURES, [0.335, 0.05, 0.2], [0.001, 0.2, 0.0]),  # The base beside its track.
        (APERTURES, [0.335, 0.52, 0.5], [0.0, 0.85, 0.0]),  # The base beyond its track's end.
        (APERTURES, [0.335, 0.05, 0.9], [0.0, 0.1, 0.0]),  # A hand turned too far.
        (APERTURES, [0.335, 0.05, -0.7], [0.0, 0.0, 0.0]),  # Beyond the joint limits.
        (LINE, [0.335, 0.3, 0.0], [0.0, 0.0, 0.0]),  # Beyond the joint limits.
        (LINE, [0.335, 0.0, 1.0], [0.1, 0.0, 0.0]),  # A base that does not move.
    ],
)
def test_what_is_not_feasible(starts: LineStarts, x0: list[float], b0: list[float]) -> None:
    assert starts.solve(np.array(x0), np.array(b0)) is None
    assert APERTURES.solve(np.array([0.335, 0.05, 0.2]), np.array([0.0, 0.2, 0.0])) is not None


# Regions


APERTURE = Region(
    lower=np.array([0.5, 0.1, 0.9, 0.0, -1.0, 0.0, 0.0]),
    upper=np.array([0.5, 0.1, 0.9, 1.0, 1.0, 0.0, 0.0]),
    b0_lower=np.array([0.0, -0.3, 0.0]),
    b0_upper=np.array([0.0, 0.3, 0.3]),
)


def test_clipping_in_space_keeps_a_unit_quaternion_about_x() -> None:
    tilted = np.array([0.5001, 0.1, 0.9, 0.6, 0.8, 1e-3, -1e-3])
    x0, b0 = APERTURE.clip(tilted, np.array([1e-4, 0.5, -0.1]))
    np.testing.assert_allclose(x0, [0.5, 0.1, 0.9, 0.6, 0.8, 0.0, 0.0], atol=1e-6)
    assert np.linalg.norm(x0[3:]) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_array_equal(b0, [0.0, 0.3, 0.0])
    assert APERTURE.holds(x0, b0) and not APERTURE.holds(tilted, b0)


@pytest.mark.parametrize("failed_y", [[], [0.1], [-0.4, 0.0], [0.39, 0.41], [-0.9]])
def test_a_line_without_the_neighbourhood_of_failures(failed_y: list[float]) -> None:
    failed = [Start(np.array([0.335, y, 0.5])) for y in failed_y]
    (line,) = LINE.regions
    parts = line.away_from(failed, 0.1)
    for y in np.linspace(-0.4, 0.4, 321) + 1e-5:
        x0 = np.array([0.335, y, 0.0])
        free = all(abs(y - other) >= 0.1 for other in failed_y) and y <= 0.4
        assert any(part.holds(x0, np.zeros(3), 0.0) for part in parts) == free


def test_each_start_is_found_in_its_region() -> None:
    grid = APERTURES.grid
    found = find_regions(APERTURES.regions, grid)
    assert set(found) == {0, 1, 2}
    for k, start in zip(found, grid, strict=True):
        np.testing.assert_allclose(APERTURES.regions[k].lower[:2], start.x0[:2])
    beside = Starts(grid.x0 + [0.0, 0.01, 0.0], grid.b0)
    assert np.all(find_regions(APERTURES.regions, beside) == -1)
