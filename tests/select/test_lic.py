import numpy as np
import pytest
from select_surfaces import Bumps, random_bumps

from lic_drake.errors import RequestError
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.reach.task import StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.select.lic import LbfgsbSelector, LicSelector
from lic_drake.select.situation import Situation, StartSet

ARM = planar_arm()
STARTS = StartSet(arm=ARM, line=StartLine())
GOAL = np.array([0.6, 0.1, 0.0])


def _best_of_dense_scan(selector: LicSelector, situation: Situation) -> float:
    scan = STARTS.scan(161, 181)
    return float(selector.evaluate(GOAL, scan[situation.allowed(scan)]).max())


def test_peak_inside_the_feasible_set_is_found_exactly() -> None:
    peak = np.array([0.013, 1.0])
    surface = Bumps(peak[None], np.array([0.9]), np.array([0.2, 0.6]))
    chosen = LicSelector(ARM, surface, PLANAR_LIC1).select(Situation(p_WG=GOAL, starts=STARTS))
    np.testing.assert_allclose(chosen.x0[1:], peak, atol=1e-3)
    assert chosen.probability == pytest.approx(0.9, abs=1e-5)


def test_peak_that_the_arm_cannot_take_gives_the_best_start_at_the_joint_limits() -> None:
    # A hand at y = 0.3 m cannot point straight ahead: phi must be at least 52 degrees there.
    surface = Bumps(np.array([[0.3, 0.0]]), np.array([0.9]), np.array([0.1, 0.4]))
    selector = LicSelector(ARM, surface, PLANAR_LIC1)
    situation = Situation(p_WG=GOAL, starts=STARTS)
    chosen = selector.select(situation)
    assert chosen.probability is not None
    assert chosen.probability >= 0.99 * _best_of_dense_scan(selector, situation)
    margin = np.min(np.minimum(chosen.q - ARM.q_min, ARM.q_max - chosen.q))
    assert 0.0 <= margin + 1e-9 < np.deg2rad(2.0)


@pytest.mark.parametrize("kind", [LicSelector, LbfgsbSelector])
@pytest.mark.parametrize("seed", range(8))
def test_selection_matches_a_dense_scan_and_beats_every_grid_start(
    kind: type[LicSelector], seed: int
) -> None:
    selector = kind(ARM, random_bumps(seed), PLANAR_LIC1)
    situation = Situation(p_WG=GOAL, starts=STARTS)
    chosen = selector.select(situation)
    value = float(selector.evaluate(GOAL, chosen.x0[None])[0])
    assert value >= selector.evaluate(GOAL, STARTS.grid).max() - 1e-12
    assert value >= 0.99 * _best_of_dense_scan(selector, situation)


@pytest.mark.parametrize("seed", range(5))
def test_second_selection_keeps_away_from_the_first_and_is_the_best_there(seed: int) -> None:
    selector = LicSelector(ARM, random_bumps(seed), PLANAR_LIC1)
    first = selector.select(Situation(p_WG=GOAL, starts=STARTS))
    situation = Situation(p_WG=GOAL, starts=STARTS, failed=(first.x0,))
    second = selector.select(situation)
    assert abs(second.x0[1] - first.x0[1]) > 0.1
    value = float(selector.evaluate(GOAL, second.x0[None])[0])
    assert value >= 0.99 * _best_of_dense_scan(selector, situation)


def test_selection_without_a_start_left_is_refused() -> None:
    failed = tuple(np.array([0.335, y, 1.0]) for y in np.arange(-0.4, 0.41, 0.1))
    selector = LicSelector(ARM, random_bumps(0), PLANAR_LIC1)
    with pytest.raises(RequestError, match="no start is left"):
        selector.select(Situation(p_WG=GOAL, starts=STARTS, failed=failed))


def test_goal_with_nan_is_refused() -> None:
    with pytest.raises(RequestError, match="finite"):
        Situation(p_WG=np.array([np.nan, 0.0, 0.0]), starts=STARTS)
