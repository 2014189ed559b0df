from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydrake.math import RollPitchYaw, RotationMatrix
from scipy.stats import chisquare
from support.starts import APERTURES, ARM, LINE

from lic_drake.errors import RequestError
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.start import Start
from lic_drake.robots.registry import get_robot
from lic_drake.select.baselines import CostSelector, Hand, RandomSelector, corridor_cost
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts

GOAL = np.array([0.6, 0.1, 0.0])
HAND, GRIPPER = Hand.of(ARM), Hand.of(get_robot("pr2"))


def failed(*starts: np.ndarray) -> tuple[FailedReach, ...]:
    return tuple(FailedReach.from_start(Start(x0)) for x0 in starts)


@given(st.floats(-0.4, 0.4), st.floats(0.0, 1.5), st.floats(0.01, 0.5))
def test_cost_grows_with_distance_and_with_the_angle_to_the_goal(
    y: float, angle: float, further: float
) -> None:
    def cost(distance: float, angle: float) -> float:
        goal = np.array([0.335 + distance, y, 0.0])
        return float(corridor_cost(np.array([[0.335, y, angle]]), goal, HAND)[0])

    assert cost(0.2 + further, angle) > cost(0.2, angle)
    assert cost(0.2, angle + 0.05) > cost(0.2, angle)


@pytest.mark.parametrize(("angle", "sine"), [(0.0, 0.0), (0.6, np.sin(0.6)), (2.5, 1.0)])
@pytest.mark.parametrize("roll", [0.0, 0.7, -3.0])
def test_the_cost_is_the_corridor_of_the_hand_and_of_its_length_aside(
    angle: float, sine: float, roll: float
) -> None:
    flat = np.array([[0.335, 0.1, angle]])
    expected = (0.6 - 0.335) * (0.05 + 0.288 * sine)
    assert corridor_cost(flat, GOAL, HAND)[0] == pytest.approx(expected)
    # In space the hand is turned to the left by the angle, and all about Wx by the roll.
    r = GRIPPER.radius_m + 0.05
    R_WE = RotationMatrix(RollPitchYaw(roll, 0.0, 0.0)) @ RotationMatrix.MakeZRotation(angle)
    x0 = np.array([[0.5, -0.2, 0.9, *R_WE.ToQuaternion().wxyz()]])
    expected = 0.3 * (np.pi * r**2 + 2.0 * r * 0.18 * sine)
    assert corridor_cost(x0, np.array([0.8, -0.2, 0.9]), GRIPPER)[0] == pytest.approx(expected)


def test_random_selector_draws_every_start_equally_often() -> None:
    selector = RandomSelector(rng=np.random.default_rng(1))
    situation = Situation(p_WG=GOAL, starts=LINE)
    drawn = [tuple(selector.select(situation).start.x0) for _ in range(4200)]
    counts = [drawn.count(tuple(x0)) for x0 in LINE.grid.x0]
    assert sum(counts) == 4200
    assert chisquare(counts).pvalue > 1e-3


def test_random_selector_draws_any_start_again_after_failures() -> None:
    selector = RandomSelector(rng=np.random.default_rng(1))
    failed = tuple(FailedReach.from_start(start) for start in LINE.grid)
    situation = Situation(p_WG=GOAL, starts=LINE, failed=failed)
    drawn = {tuple(selector.select(situation).start.x0) for _ in range(300)}
    assert drawn == set(map(tuple, LINE.grid.x0))


def test_random_selector_without_any_start_says_so() -> None:
    nowhere = SimpleNamespace(grid=LINE.grid.take(np.zeros(0, dtype=int)))
    situation = Situation(p_WG=GOAL, starts=nowhere)
    with pytest.raises(RequestError, match="no discrete start is feasible here"):
        RandomSelector(rng=np.random.default_rng(1)).select(situation)


def test_cost_takes_the_cheapest_start_and_then_the_cheapest_away_from_it() -> None:
    grid = LINE.grid.x0
    first = CostSelector().select(Situation(p_WG=GOAL, starts=LINE))
    cost = corridor_cost(first.start.x0[None], GOAL, HAND)[0]
    assert cost == corridor_cost(grid, GOAL, HAND).min()
    second = CostSelector().select(Situation(p_WG=GOAL, starts=LINE, failed=failed(first.start.x0)))
    away = np.abs(grid[:, 1] - first.start.x0[1]) > 0.1 + 1e-6
    assert abs(second.start.x0[1] - first.start.x0[1]) > 0.1
    assert corridor_cost(second.start.x0[None], GOAL, HAND)[0] == pytest.approx(
        corridor_cost(grid[away], GOAL, HAND).min()
    )


@settings(max_examples=30)
@given(st.floats(0.45, 0.85), st.floats(-0.4, 0.4))
def test_of_equally_cheap_starts_cost_takes_the_base_nearest_to_the_goals_y(
    x: float, y: float
) -> None:
    p_WG = np.array([x, y, 0.0])
    chosen = CostSelector().select(Situation(p_WG=p_WG, starts=APERTURES))
    grid = APERTURES.grid
    costs = np.array([corridor_cost(x0[None], p_WG, HAND)[0] for x0 in grid.x0])
    equal = costs <= costs.min() + 1e-9
    assume(np.unique(grid.b0[equal], axis=0).shape[0] > 1)
    assert corridor_cost(chosen.start.x0[None], p_WG, HAND)[0] == pytest.approx(
        costs.min(), abs=1e-9
    )
    nearest = np.abs(grid.b0[equal, 1] - y).min()
    assert abs(chosen.start.b0[:2][1] - y) == pytest.approx(nearest, abs=1e-9)


def test_cost_moves_a_pr2_no_further_than_the_aperture_asks_for() -> None:
    scenario = load_scenario("sphere-aperture-clutter", "{clutter: {num_blocked: 10}}")
    starts = make_starts(scenario, scenario.sample_instance("calibration", 0))
    p_WG = scenario.sample_goal("calibration", 0)
    b0 = np.array([0.0, 0.0, scenario.task.torso_m])
    chosen = CostSelector().select(Situation(p_WG=p_WG, starts=starts))
    grid = starts.grid
    costs = corridor_cost(grid.x0, p_WG, GRIPPER)
    assert corridor_cost(chosen.start.x0[None], p_WG, GRIPPER)[0] == pytest.approx(
        costs.min(), abs=1e-9
    )
    here = np.abs(costs - costs.min()) < 1e-9
    least = np.linalg.norm(grid.b0[here] - b0, axis=1).min()
    moved = np.linalg.norm([*chosen.start.b0[:2], chosen.start.b0[2]] - b0)
    assert moved == pytest.approx(least, abs=1e-9)
