from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.task import BaseTrack, GoalArea, Stand, StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.robots.pr2 import TORSO_RANGE_M

ARM = planar_arm()
TASK = load_scenario("cylinder-clutter").task


# By hand from the joint limits: where on the line each orientation in degrees is possible, dm.
@pytest.mark.parametrize(
    ("name", "possible"),
    [
        ("cylinder-clutter", {-30: (-4, -3), 0: (-4, -2), 30: (-3, 0), 60: (-2, 3), 90: (-1, 4)}),
        ("passage-clutter", {0: (-4, -2), 45: (-3, 1), 90: (-1, 4)}),
    ],
)
def test_start_grids_have_the_papers_initial_conditions(
    name: str, possible: dict[int, tuple[int, int]]
) -> None:
    line = load_scenario(name).task.start_line
    grid = line.grid(ARM)
    assert len(grid) == (21 if name == "cylinder-clutter" else 14)
    assert set(grid[:, 0]) == {line.x_m}
    found = {(round(np.rad2deg(phi)), round(10.0 * y)) for _, y, phi in grid}
    assert found == {(phi, y) for phi, (lo, hi) in possible.items() for y in range(lo, hi + 1)}


def test_the_goal_grid_has_the_papers_45_goals() -> None:
    area = TASK.goal_area
    grid = area.grid()
    assert grid.shape == (45, 3)
    x = [round(area.lower[0] + 0.1 * i, 12) for i in range(5)]
    y = [-0.4, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4]
    assert [tuple(goal) for goal in grid] == [(xi, yi, 0.0) for xi in x for yi in y]


def test_sampled_goals_fill_the_area_evenly() -> None:
    area = GoalArea(lower=[0.4, -0.4], upper=[0.8, 0.4])
    rng = np.random.default_rng(0)
    goals = np.array([area.sample(rng)[:2] for _ in range(4000)])
    cells, _, _ = np.histogram2d(*goals.T, bins=4, range=[[0.4, 0.8], [-0.4, 0.4]])
    assert np.all((goals >= area.lower) & (goals <= area.upper))
    # 16 cells of 250 expected draws; 5 standard deviations of a binomial count are 77.
    assert np.all(np.abs(cells - 250.0) < 77.0)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (StartLine, {"y_min_m": 0.5}, "start line y_m: needs finite numbers with min <= max"),
        (StartLine, {"phi_max_deg": np.nan}, "start line phi_deg: needs finite numbers"),
        (StartLine, {"x_m": np.inf}, "x_m must be a finite number, got inf"),
        (StartLine, {"y_step_m": 1e-6}, "at most 1000 positive steps"),
        (GoalArea, {"lower": [0.9, -0.4]}, "goal area x: needs finite numbers with min <= max"),
        (GoalArea, {"upper": [0.8]}, r"goal area corners must be \[x, y\]"),
        (GoalArea, {"random_goals": -1}, "random_goals must be 0 or a positive number, got -1"),
        (BaseTrack, {"starts_per_aperture": 0}, "starts_per_aperture must be a positive number"),
        (Stand, {"torso_max_m": np.nan}, "stand torso_m: needs finite numbers"),
        (Stand, {"training_y_m": []}, "training_y_m and training_torso_m need one number"),
        (
            Stand,
            {"training_torso_m": [0.1]},
            r"training_torso_m must be from 0.15 .* \[0.1\]",
        ),
    ],
)
def test_impossible_values_are_refused(kind: type, values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        kind(**values)


@given(st.integers(1, 5), st.integers(1, 4), st.integers(0, 200))
def test_environments_of_a_library_have_all_places_with_all_heights_in_turn(
    places: int, heights: int, first: int
) -> None:
    stand = Stand(
        y_min_m=-1.0,
        y_max_m=1.0,
        torso_min_m=0.0,
        torso_max_m=0.3,
        training_y_m=np.linspace(-1.0, 1.0, places).tolist(),
        training_torso_m=np.linspace(0.0, 0.3, heights).tolist(),
    )
    every = [(y, torso) for torso in stand.training_torso_m for y in stand.training_y_m]
    # Wherever a library begins, as many environments as there are pairs have each of them once.
    found = [stand.for_training(first + i) for i in range(len(every))]
    assert sorted(found) == sorted(every)
    assert [stand.for_training(i) for i in range(2 * len(every))] == 2 * every


def test_the_shipped_stand_is_the_robots_range_and_has_its_libraries_places_inside() -> None:
    stand = load_scenario("sphere-aperture-clutter").task.stand
    assert stand is not None
    assert (stand.torso_min_m, stand.torso_max_m) == TORSO_RANGE_M
    assert {stand.for_training(i) for i in range(40)} == {
        (y, torso) for y in (-0.075, -0.025, 0.025, 0.075) for torso in (0.1, 0.2)
    }
    assert load_scenario("cylinder-clutter").task.stand is None
