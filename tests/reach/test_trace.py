import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.reach.trace import ReachTrace

PERIOD_S = 0.04


def trace_of(positions: np.ndarray, forces: np.ndarray | None = None) -> ReachTrace:
    """A trace of tip positions in the plane, shape (n, 2), a control period apart."""
    trace = ReachTrace()
    for k, (x, y) in enumerate(positions):
        force = np.zeros(3) if forces is None else forces[k]
        trace.append(k * PERIOD_S, np.zeros(3), np.array([x, y, 0.0]), force)
    return trace


def moving(times: np.ndarray, vx: float, vy: float) -> np.ndarray:
    return np.column_stack([vx * times, vy * times])


@given(st.floats(-1, 1), st.floats(-1, 1), st.integers(1, 200))
def test_a_constant_velocity_is_the_final_velocity(vx: float, vy: float, steps: int) -> None:
    times = PERIOD_S * np.arange(steps + 1)
    velocity = trace_of(moving(times, vx, vy)).final_velocity(still_s=0.0)
    np.testing.assert_allclose(velocity, [vx, vy, 0.0], atol=1e-12)


def test_only_the_last_second_of_motion_counts() -> None:
    # 3 s along x, then 2 s along y.
    times = PERIOD_S * np.arange(126)
    path = np.column_stack([0.1 * np.minimum(times, 3.0), 0.2 * np.maximum(times - 3.0, 0.0)])
    trace = trace_of(path)
    np.testing.assert_allclose(trace.final_velocity(0.0), [0.0, 0.2, 0.0], atol=1e-12)


def test_the_stuck_window_is_left_out() -> None:
    # 3 s of motion, then 4 s at rest, as the stuck rule leaves a reach.
    times = PERIOD_S * np.arange(176)
    trace = trace_of(moving(np.minimum(times, 3.0), 0.1, -0.05))
    np.testing.assert_allclose(trace.final_velocity(4.0), [0.1, -0.05, 0.0], atol=1e-12)
    np.testing.assert_array_equal(trace.final_velocity(0.0), np.zeros(3))


def test_a_reach_shorter_than_the_window_uses_all_of_it() -> None:
    velocity = trace_of(moving(PERIOD_S * np.arange(6), 0.5, 0.0)).final_velocity(0.0)
    np.testing.assert_allclose(velocity, [0.5, 0.0, 0.0])


@pytest.mark.parametrize("still_s", [0.0, 4.0])
def test_without_motion_before_the_stuck_window_there_is_no_velocity(still_s: float) -> None:
    np.testing.assert_array_equal(trace_of(np.ones((1, 2))).final_velocity(still_s), np.zeros(3))
    never_moved = trace_of(np.ones((101, 2)))
    np.testing.assert_array_equal(never_moved.final_velocity(still_s), np.zeros(3))


def test_forces_are_kept_as_peak_sum_and_number_of_loaded_taxels() -> None:
    forces = np.array([[0.0, 0.0, 0.0], [3.0, 1.0, 0.0], [0.0, 0.0, 8.0]])
    trace = trace_of(np.zeros((3, 2)), forces)
    assert trace.peak_force == [0.0, 3.0, 8.0]
    assert trace.total_force == [0.0, 4.0, 8.0]
    assert trace.contacts == [0, 2, 1]
    # 12 N on three loaded taxels.
    assert trace.mean_force == 4.0
