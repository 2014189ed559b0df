import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chisquare

from lic_drake.errors import RequestError
from lic_drake.reach.task import StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.select.baselines import CostSelector, RandomSelector, corridor_cost
from lic_drake.select.situation import Situation, StartSet

STARTS = StartSet(arm=planar_arm(), line=StartLine())
GOAL = np.array([0.6, 0.1, 0.0])


def test_cost_of_a_hand_that_points_at_the_goal_is_its_own_corridor() -> None:
    x0 = np.array([[0.335, 0.1, 0.0]])
    assert corridor_cost(x0, GOAL)[0] == pytest.approx((0.6 - 0.335) * 0.05)


def test_cost_of_a_hand_across_the_way_adds_its_whole_length() -> None:
    x0 = np.array([[0.335, 0.1, np.pi / 2]])
    assert corridor_cost(x0, GOAL)[0] == pytest.approx((0.6 - 0.335) * (0.05 + 0.288))


@given(st.floats(-0.4, 0.4), st.floats(0.0, 1.5), st.floats(0.01, 0.5))
def test_cost_grows_with_distance_and_with_the_angle_to_the_goal(
    y: float, angle: float, further: float
) -> None:
    def cost(distance: float, angle: float) -> float:
        goal = np.array([0.335 + distance, y, 0.0])
        return float(corridor_cost(np.array([[0.335, y, angle]]), goal)[0])

    assert cost(0.2 + further, angle) > cost(0.2, angle)
    assert cost(0.2, angle + 0.05) > cost(0.2, angle)


def test_random_selector_draws_every_start_equally_often() -> None:
    selector = RandomSelector(rng=np.random.default_rng(1))
    situation = Situation(p_WG=GOAL, starts=STARTS)
    drawn = [tuple(selector.select(situation).x0) for _ in range(4200)]
    counts = [drawn.count(tuple(x0)) for x0 in STARTS.grid]
    assert sum(counts) == 4200
    assert chisquare(counts).pvalue > 1e-3


def test_random_selector_does_not_repeat_failed_starts() -> None:
    failed = tuple(STARTS.grid[:-1])
    selector = RandomSelector(rng=np.random.default_rng(1))
    situation = Situation(p_WG=GOAL, starts=STARTS, failed=failed)
    assert np.array_equal(selector.select(situation).x0, STARTS.grid[-1])
    with pytest.raises(RequestError, match="no start is left"):
        selector.select(Situation(p_WG=GOAL, starts=STARTS, failed=tuple(STARTS.grid)))


def test_cost_selector_takes_the_cheapest_start() -> None:
    chosen = CostSelector().select(Situation(p_WG=GOAL, starts=STARTS))
    costs = corridor_cost(STARTS.grid, GOAL)
    assert corridor_cost(chosen.x0[None], GOAL)[0] == costs.min()
    assert chosen.probability is None


def test_second_cost_selection_is_the_best_away_from_the_first() -> None:
    first = CostSelector().select(Situation(p_WG=GOAL, starts=STARTS))
    second = CostSelector().select(Situation(p_WG=GOAL, starts=STARTS, failed=(first.x0,)))
    away = np.abs(STARTS.grid[:, 1] - first.x0[1]) > 0.1 + 1e-6
    assert abs(second.x0[1] - first.x0[1]) > 0.1
    assert corridor_cost(second.x0[None], GOAL)[0] == pytest.approx(
        corridor_cost(STARTS.grid[away], GOAL).min()
    )


def test_selected_joint_angles_put_the_hand_at_the_start() -> None:
    chosen = CostSelector().select(Situation(p_WG=GOAL, starts=STARTS))
    np.testing.assert_allclose(STARTS.arm.tip_pose(chosen.q), chosen.x0, atol=1e-12)
