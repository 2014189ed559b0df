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
from lic_drake.reach.start import Starts
from lic_drake.reach.task import BaseTrack
from lic_drake.starts import LineStarts, make_starts, training_starts

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
            if -0.6 <= round(p_WA[1] - y, 9) <= 0.6
        }
        found = [tuple(np.round([s.x0[1], s.b0[1], s.x0[2]], 9)) for s in some]
        assert len(found) == len(expected)
        assert set(found) == expected


def test_equal_bases_have_equal_numbers() -> None:
    # Two apertures a grid step apart: some bases serve both, and rounding must not split them.
    bases = aperture_starts([-0.05, 0.05]).grid.b0[:, 1]
    assert len(np.unique(bases)) == len(np.unique(np.round(bases, 6)))


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
    assert counts.tolist() == [5, 5, 5]
    assert len(np.unique(np.hstack([tried.x0, tried.b0]), axis=0)) == 15
    # They are a function of stream and environment.
    training_starts(SCENARIO, "training", 4)
    again = training_starts(load_scenario("cylinder-aperture-clutter"), "training", 3)
    np.testing.assert_array_equal(tried.x0, again.x0)
    np.testing.assert_array_equal(tried.b0, again.b0)
    assert not np.any(np.isin(tried.x0[:, 2], training_starts(SCENARIO, "holdout", 3).x0[:, 2]))


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
        (APERTURES, [0.336, 0.05, 0.2], [0.001, 0.2, 0.0]),  # Before an aperture.
        (APERTURES, [0.335, 0.05, 0.2], [0.001, 0.2, 0.0]),  # The base beside its track.
        (APERTURES, [0.335, 0.52, 0.5], [0.0, 0.75, 0.0]),  # The base beyond its track's end.
        (APERTURES, [0.335, 0.05, 0.9], [0.0, 0.1, 0.0]),  # A hand turned too far.
        (APERTURES, [0.335, 0.05, -0.7], [0.0, 0.0, 0.0]),  # Beyond the joint limits.
        (LINE, [0.4, 0.0, 1.0], [0.0, 0.0, 0.0]),  # Off the line.
        (LINE, [0.335, 0.3, 0.0], [0.0, 0.0, 0.0]),  # Beyond the joint limits.
        (LINE, [0.335, 0.0, 1.0], [0.1, 0.0, 0.0]),  # A base that does not move.
    ],
)
def test_what_is_not_feasible(starts: LineStarts, x0: list[float], b0: list[float]) -> None:
    assert starts.solve(np.array(x0), np.array(b0)) is None
    assert APERTURES.solve(np.array([0.335, 0.05, 0.2]), np.array([0.0, 0.2, 0.0])) is not None


def test_an_environment_without_apertures_has_the_starts_of_a_line() -> None:
    instance = replace(SCENARIO.sample_instance("training", 0), p_WA=None)
    assert len(make_starts(SCENARIO, instance).regions) == 1
