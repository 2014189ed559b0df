from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.fake_reach import make_record
from support.reaches import reach_request
from support.starts import APERTURES, LINE

from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import LineStarts

GOAL = np.array([0.6, 0.1, 0.0])


@given(
    st.sampled_from([LINE, APERTURES]),
    st.lists(st.floats(-0.6, 0.6), max_size=5),
    st.floats(-0.4, 0.4),
)
def test_free_regions_are_the_allowed_positions(
    starts: LineStarts, failed_y: list[float], y: float
) -> None:
    if starts is APERTURES:
        y = float(APERTURES.p_WA[np.argmin(np.abs(APERTURES.p_WA[:, 1] - y)), 1])
    failed = tuple(
        FailedReach.from_start(Start(np.array([0.335, value, 0.5]))) for value in failed_y
    )
    situation = Situation(p_WG=GOAL, starts=starts, failed=failed)
    regions = situation.free_regions()
    inside = any(region.lower[1] <= y <= region.upper[1] for region in regions)
    at = Starts(np.array([[0.335, y, 0.0]]), np.zeros((1, 3)))
    distance = situation.retry_distance_m
    near_an_edge = any(abs(abs(y - value) - distance) < 1e-5 for value in failed_y)
    assert inside == bool(situation.allowed(at)[0]) or near_an_edge
    # What is cut is y alone.
    for region in regions:
        parents = [
            whole
            for whole in starts.regions
            if whole.lower[1] <= region.lower[1] and region.upper[1] <= whole.upper[1]
        ]
        assert len(parents) == 1
        np.testing.assert_array_equal(region.lower[[0, 2]], parents[0].lower[[0, 2]])
        np.testing.assert_array_equal(region.b0_lower, parents[0].b0_lower)
        np.testing.assert_array_equal(region.b0_upper, parents[0].b0_upper)


@given(
    st.sampled_from([LINE, APERTURES]),
    st.lists(st.floats(-0.6, 0.6), max_size=9),
    st.lists(st.integers(0, 17), max_size=25),
)
def test_the_neighbourhood_of_failures_is_as_large_as_leaves_a_start_of_the_grid(
    starts: LineStarts, failed_y: list[float], failed_rows: list[int]
) -> None:
    grid = starts.grid
    failed = [FailedReach.from_start(Start(np.array([0.335, y, 0.5]))) for y in failed_y]
    failed += [FailedReach.from_start(grid[i]) for i in failed_rows]
    situation = Situation(p_WG=GOAL, starts=starts, failed=tuple(failed))
    allowed = situation.allowed(grid)
    nearest = np.min(
        [np.full(len(grid.x0), np.inf), *(np.abs(grid.x0[:, 1] - r.start.x0[1]) for r in failed)],
        axis=0,
    )
    repeated = np.array(
        [
            any(np.allclose(x0, r.start.x0) and np.allclose(b0, r.start.b0) for r in failed)
            for x0, b0 in zip(grid.x0, grid.b0, strict=True)
        ]
    )
    for distance in (0.1, 0.05, 0.025, 0.0, -1.0):
        expected = ~repeated & (nearest > distance + 1e-9)
        if expected.any() or distance < 0.0:
            np.testing.assert_array_equal(allowed, expected)
            break


# In space


class InSpace:
    """Hands at three heights and two places across x, each from two heights of the torso."""

    def __init__(self) -> None:
        places = [(y, z) for y in (-0.3, 0.1) for z in (0.7, 0.9, 1.1)]
        x0 = np.array([[0.53, y, z, 1.0, 0.0, 0.0, 0.0] for y, z in places])
        torso_m = np.repeat([0.1, 0.25], len(x0))
        self.grid = Starts(np.vstack([x0, x0]), np.pad(torso_m[:, None], ((0, 0), (2, 0))))


def test_in_space_a_failed_aperture_is_tried_again_from_elsewhere_only() -> None:
    starts = InSpace()
    at = Start(np.array([0.53, -0.3, 0.9, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.1]))
    near = np.linalg.norm(starts.grid.x0[:, 1:3] - [-0.3, 0.9], axis=1) <= 0.1
    near &= starts.grid.b0[:, 2] == 0.1
    assert np.count_nonzero(near) == 1
    failed = (FailedReach.from_start(at),)
    situation = Situation(p_WG=GOAL, starts=starts, failed=failed)
    np.testing.assert_array_equal(situation.allowed(starts.grid), ~near)
    # Deeper makes no difference.
    deeper = Starts(starts.grid.x0 + np.eye(7)[0], starts.grid.b0)
    np.testing.assert_array_equal(situation.allowed(deeper), ~near)


def test_a_failed_reach_in_space_shows_heights_and_torso_of_its_record() -> None:
    planar = make_record(reach_request(load_scenario("cylinder-clutter")))
    heights = {"start_z": 0.9, "start_qx": 0.6, "final_z": 1.0, "final_vz": -0.1, "torso": 0.2}
    record = replace(planar, start_qw=0.8, **heights)
    failed = FailedReach.from_record(record)
    np.testing.assert_array_equal(
        failed.start.x0, [record.start_x, record.start_y, 0.9, 0.8, 0.6, 0.0, 0.0]
    )
    assert failed.start.b0[2] == 0.2
    assert [failed.shown[name] for name in list(heights)[:4]] == [0.9, 0.6, 1.0, -0.1]
