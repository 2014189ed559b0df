"""Motions in closed form, and the sample at which each rule must end them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.errors import ScenarioError
from lic_drake.reach.simulation import StopMonitor
from lic_drake.reach.task import StopConfig

PERIOD_S = 0.04
FAR = np.array([10.0, 0.0, 0.0])
RULES = StopConfig(
    success_distance_m=0.015,
    stuck_distance_m=0.002,
    stuck_time_s=4.0,
    timeout_s=30.0,
    force_limit_N=50.0,
    force_time_s=0.1,
)


def still(t: float) -> float:
    return 0.0


def ending(
    x: Callable[[float], float],
    force: Callable[[float], float] = still,
    p_WG: np.ndarray = FAR,
    config: StopConfig = RULES,
    period_s: float = PERIOD_S,
) -> tuple[str, int]:
    """Outcome and index of the sample that ends a motion along x."""
    monitor = StopMonitor(config, p_WG, period_s)
    for k in range(100_000):
        t = k * period_s
        outcome = monitor.update(t, np.array([x(t), 0.0, 0.0]), force(t))
        if outcome is not None:
            return outcome, k
    raise AssertionError("no rule ended the motion")


def test_a_straight_line_reaches_when_it_is_near_enough() -> None:
    # 0.1 - 0.004 k < 0.015 from k = 22 on.
    assert ending(lambda t: 0.1 * t, p_WG=np.array([0.1, 0.0, 0.0])) == ("reached", 22)


def test_standing_still_is_stuck_after_exactly_four_seconds() -> None:
    assert ending(still) == ("stuck", 100)
    assert ending(still, period_s=0.01) == ("stuck", 400)


def test_a_slow_reach_is_out_of_time_at_the_sample_of_the_timeout() -> None:
    short = replace(RULES, timeout_s=1.2)
    assert ending(lambda t: 0.01 * t, config=short) == ("timeout", 30)
    # 0.1 s is no multiple of 0.04 s: the first sample after it ends the reach.
    assert ending(still, config=replace(RULES, timeout_s=0.1)) == ("timeout", 3)


def test_force_ends_a_reach_when_it_is_over_the_limit_for_long_enough() -> None:
    # 10 N/s: exactly 50 N at sample 125 are allowed; 0.1 s later is sample 127.5.
    assert ending(lambda t: 0.01 * t, lambda t: 10.0 * t) == ("force", 128)
    # At 100 Hz it is samples 500 and 510.
    assert ending(lambda t: 0.01 * t, lambda t: 10.0 * t, period_s=0.01) == ("force", 510)


def test_a_force_that_is_no_number_counts_as_too_high() -> None:
    assert ending(lambda t: 0.01 * t, lambda t: np.nan) == ("force", 3)


# Progress towards the goal

SLOW = replace(RULES, progress_m=0.01, progress_time_s=2.0)


def test_a_motion_that_comes_no_nearer_than_before_makes_no_progress() -> None:
    def to_and_fro(t: float) -> float:
        """5 cm to and fro every 2 s, nearest at 0.5 s; the samples beside it are 4 um further."""
        return 0.05 * np.sin(np.pi * t)

    # At 2.32 s the window begins at 0.32 s, 7.8 mm behind the nearest; at 0.28 s it was 11.5 mm.
    moving = replace(RULES, stuck_time_s=np.inf)
    slow = replace(SLOW, stuck_time_s=np.inf)
    assert ending(to_and_fro, config=slow) == ("stuck", 58)
    assert ending(to_and_fro, config=moving) == ("timeout", 750)
    assert ending(lambda t: -0.05 * t, config=SLOW) == ("stuck", 50)
    assert ending(lambda t: -0.05 * t, config=RULES) == ("timeout", 750)


@pytest.mark.parametrize("stuck_time_s", [30.04, np.inf])
def test_a_stuck_time_over_the_timeout_switches_the_rule_off(stuck_time_s: float) -> None:
    assert ending(still, config=replace(RULES, stuck_time_s=stuck_time_s)) == ("timeout", 750)


@given(
    st.lists(
        st.tuples(st.floats(-0.002, 0.002), st.sampled_from([0.0, 50.0, 51.0])),
        min_size=1,
        max_size=60,
    ),
    st.integers(1, 20),
    st.integers(1, 70),
    st.floats(-0.02, 0.02),
    st.sampled_from([0.0, 0.0007, 0.002]),
    st.integers(1, 20),
)
def test_the_first_rule_that_holds_over_the_whole_motion_ends_it(
    samples: list[tuple[float, float]],
    window: int,
    last: int,
    goal: float,
    progress: float,
    slow: int,
) -> None:
    config = StopConfig(
        success_distance_m=0.004,
        stuck_distance_m=0.0005,
        stuck_time_s=window * PERIOD_S,
        progress_m=progress,
        progress_time_s=slow * PERIOD_S,
        timeout_s=last * PERIOD_S,
        force_limit_N=50.0,
        force_time_s=1.5 * PERIOD_S,
    )
    x = np.cumsum([step for step, _ in samples])
    force = np.array([value for _, value in samples])
    k = np.arange(len(x))
    back = np.where(k >= window, np.abs(x - x[np.maximum(k - window, 0)]), np.inf)
    nearest = np.minimum.accumulate(np.abs(x - goal))
    gained = np.where(k >= slow, nearest[np.maximum(k - slow, 0)] - nearest, np.inf)
    holds = {
        "reached": np.abs(x - goal) < 0.004,
        # Two samples in a row; there is nothing before the first.
        "force": (force > 50.0) & (np.roll(force, 1) > 50.0) & (k > 1),
        "stuck": (back < 0.0005) | (gained < progress),
        "timeout": k >= last,
    }
    ends = np.flatnonzero(np.any(list(holds.values()), axis=0))
    expected = (
        (next(name for name, held in holds.items() if held[ends[0]]), ends[0])
        if len(ends)
        else (None, k[-1])
    )
    monitor = StopMonitor(config, np.array([goal, 0.0, 0.0]), PERIOD_S)
    for i in k:
        outcome = monitor.update(i * PERIOD_S, np.array([x[i], 0.0, 0.0]), force[i])
        if outcome is not None:
            break
    assert (outcome, i) == expected
    assert monitor.min_distance == pytest.approx(np.abs(x[: i + 1] - goal).min(), abs=1e-12)


@pytest.mark.parametrize(
    ("name", "value"),
    [("success_distance_m", 0.0), ("force_time_s", -1.0), ("progress_m", np.nan)],
)
def test_limits_are_not_negative(name: str, value: float) -> None:
    with pytest.raises(ScenarioError, match=f"{name} must be .*, got {value}"):
        StopConfig(**{name: value})
    with pytest.raises(ScenarioError, match="timeout_s must be from 0 to 3600, got inf"):
        StopConfig(timeout_s=np.inf)
