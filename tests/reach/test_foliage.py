"""Reaches of the PR2 into foliage."""

import numpy as np
import pytest

from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachResult
from lic_drake.starts import board_starts

SCENARIO = load_scenario("foliage-aperture-clutter", "{stop: {timeout_s: 3.0}}")
INSTANCE = SCENARIO.sample_instance("calibration", 1)
STARTS = board_starts(SCENARIO, INSTANCE).grid
X0 = STARTS.x0[4]
GOAL = X0[:3] + [0.3, 0.0, 0.0]  # Straight ahead, behind the foliage.


@pytest.fixture(scope="module")
def environment() -> Environment:
    return Environment(SCENARIO, INSTANCE)


@pytest.fixture(scope="module")
def result(environment: Environment) -> ReachResult:
    return environment.reach(GOAL, X0, keep_states=True)


def test_an_arm_pushes_stems_aside_and_feels_it(result: ReachResult) -> None:
    assert result.outcome in ("reached", "stuck", "timeout")
    assert result.trace.q_clutter is not None
    assert INSTANCE.stems is not None
    assert result.trace.q_clutter.shape == (np.count_nonzero(~INSTANCE.stems.fixed), 2)
    bent = np.array([state.q_clutter for state in result.trace.states])
    assert np.all(np.isfinite(bent))
    assert 0.05 < np.abs(bent).max() < 1.5
    touched = np.flatnonzero(result.trace.peak_force)
    assert len(touched)
    assert max(result.trace.peak_force) < 50.0  # The arm hits bars, too.
    # Nothing moves before it is touched, within a control period.
    np.testing.assert_array_equal(bent[: touched[0] - 1], 0.0)


def test_a_reach_finds_stems_upright_again_and_is_the_same(
    environment: Environment, result: ReachResult
) -> None:
    again = environment.reach(GOAL, X0)
    assert again.outcome == result.outcome
    np.testing.assert_array_equal(again.trace.q, result.trace.q)
    np.testing.assert_array_equal(again.trace.peak_force, result.trace.peak_force)


def test_stems_are_bent_the_same_wherever_the_base_stands(result: ReachResult) -> None:
    aside = np.array([0.0, 0.25, 0.0])
    b0 = aside + [0.0, 0.0, SCENARIO.task.torso_m]
    moved = Environment(SCENARIO, INSTANCE.translated(aside), b0=b0)
    x0 = X0.copy()
    x0[:3] += aside
    there = moved.reach(GOAL + aside, x0, keep_states=True)
    assert there.outcome == result.outcome
    # To rounding, which contact makes more of.
    for k in (0, 20, 40):
        np.testing.assert_allclose(there.trace.p_WE[k], result.trace.p_WE[k] + aside, atol=1e-6)
        here, far = result.trace.states[k].q_clutter, there.trace.states[k].q_clutter
        np.testing.assert_allclose(far, here, atol=1e-6)


def test_a_reach_ends_as_if_no_stem_had_slept(result: ReachResult) -> None:
    awake = Environment(SCENARIO, INSTANCE, sleep=False).reach(GOAL, X0, keep_states=True)
    assert awake.outcome == result.outcome
    for name in ("q", "q_clutter"):
        a, b = (
            np.array([getattr(state, name) for state in r.trace.states]) for r in (result, awake)
        )
        # The solver adds in another order: where the last digits decide it, the same period is made
        # in other steps.
        np.testing.assert_allclose(a, b, rtol=0.0, atol=5e-4)
