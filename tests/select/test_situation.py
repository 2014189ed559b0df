from dataclasses import replace

import numpy as np
import pytest
from fake_reach import make_record
from hypothesis import given
from hypothesis import strategies as st
from reaches import reach_request
from starts import APERTURES, LINE

from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.starts import InitialConditions, Starts
from lic_drake.select.situation import FailedReach, Situation

GOAL = np.array([0.6, 0.1, 0.0])


@given(
    st.sampled_from([LINE, APERTURES]),
    st.lists(st.floats(-0.6, 0.6), max_size=5),
    st.floats(-0.4, 0.4),
)
def test_free_regions_are_the_allowed_positions(
    starts: Starts, failed_y: list[float], y: float
) -> None:
    if starts is APERTURES:
        y = float(APERTURES.p_WA[np.argmin(np.abs(APERTURES.p_WA[:, 1] - y)), 1])
    failed = tuple(FailedReach.from_start(np.array([0.335, value, 0.5])) for value in failed_y)
    situation = Situation(p_WG=GOAL, starts=starts, failed=failed)
    regions = situation.free_regions()
    inside = any(region.lower[1] <= y <= region.upper[1] for region in regions)
    at = InitialConditions(np.array([[0.335, y, 0.0]]), np.zeros((1, 2)))
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
        np.testing.assert_array_equal(region.base_lower, parents[0].base_lower)
        np.testing.assert_array_equal(region.base_upper, parents[0].base_upper)


@given(
    st.sampled_from([LINE, APERTURES]),
    st.lists(st.floats(-0.6, 0.6), max_size=9),
    st.lists(st.integers(0, 17), max_size=25),
)
def test_the_neighbourhood_of_failures_is_as_large_as_leaves_a_start_of_the_grid(
    starts: Starts, failed_y: list[float], failed_rows: list[int]
) -> None:
    grid = starts.grid
    failed = [FailedReach.from_start(np.array([0.335, value, 0.5])) for value in failed_y]
    failed += [FailedReach.from_start(grid.x0[i], grid.p_WR[i]) for i in failed_rows]
    situation = Situation(p_WG=GOAL, starts=starts, failed=tuple(failed))
    allowed = situation.allowed(grid)
    nearest = np.min(
        [np.full(len(grid.x0), np.inf), *(np.abs(grid.x0[:, 1] - r.x0[1]) for r in failed)], axis=0
    )
    repeated = np.array(
        [
            any(np.allclose(x0, r.x0) and np.allclose(p_WR, r.p_WR) for r in failed)
            for x0, p_WR in zip(*grid, strict=True)
        ]
    )
    np.testing.assert_array_equal(situation.untried(grid), ~repeated)
    for distance in (0.1, 0.05, 0.025, 0.0, -1.0):
        expected = ~repeated & (nearest > distance + 1e-9)
        if expected.any() or distance < 0.0:
            np.testing.assert_array_equal(allowed, expected)
            break


@pytest.mark.parametrize("y_m", [0.0, -0.3])  # Those of this library never begin at y = -0.3 m.
def test_a_failed_reach_shows_what_its_record_says_in_the_world(y_m: float) -> None:
    request = replace(reach_request(load_scenario("cylinder-clutter"), y_m=y_m), base=(0.1, -0.2))
    record = make_record(request)
    failed = FailedReach.from_record(record)
    np.testing.assert_array_equal(failed.x0, request.start)
    np.testing.assert_array_equal(failed.p_WR, [0.1, -0.2])
    assert [failed.shown[n] for n in ("start_x", "start_y", "start_phi")] == list(request.start)
    final = ("final_x", "final_y", "final_phi", "final_vx", "final_vy")
    np.testing.assert_array_equal(
        [failed.shown[name] for name in final], [getattr(record, name) for name in final]
    )
