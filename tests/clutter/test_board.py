"""The board with apertures, alone and before spheres."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.sphere import SphereApertureClutter
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator

SCENARIO = load_scenario("sphere-aperture-clutter")
SHIPPED = SphereApertureClutter()


def sample(clutter: SphereApertureClutter, index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator("training", "spheres", index))


def is_in_board(instance: ClutterInstance, p_WQ: np.ndarray) -> np.ndarray:
    """Returns which points lie in one of the instance's boxes."""
    boxes = ~instance.movable
    inside = np.abs(p_WQ[:, None] - instance.p_WO[boxes]) <= 0.5 * instance.size[boxes] + 1e-12
    return np.any(np.all(inside, axis=2), axis=1)


def test_the_shipped_scenario_has_the_papers_numbers() -> None:
    assert SCENARIO.clutter == SHIPPED
    instance = sample(SHIPPED)
    assert np.count_nonzero(instance.movable) == 40
    np.testing.assert_array_equal(instance.size[instance.movable, 0], 0.05)
    np.testing.assert_array_equal(instance.mass[instance.movable], 0.1)
    box = np.array(SHIPPED.upper) - SHIPPED.lower
    np.testing.assert_allclose(box + [2.0 * 0.05, 0.0, 0.0], [0.29, 0.7, 0.4])
    p_WO = instance.p_WO[instance.movable]
    assert np.all((p_WO >= SHIPPED.lower) & (p_WO <= SHIPPED.upper))
    assert pdist(p_WO).min() >= 0.1


def test_goals_and_apertures_are_the_papers_grids() -> None:
    goals = SCENARIO.goals("training", 0)
    apertures = SCENARIO.sample_instance("training", 0).p_WA
    assert apertures is not None
    for grid, extent, count in ((goals, [0.0, 0.6, 0.4], 12), (apertures, [0.0, 0.8, 0.6], 20)):
        assert len(grid) == count
        np.testing.assert_allclose(np.ptp(grid, axis=0), extent, atol=1e-12)
        assert pdist(grid).min() == pytest.approx(0.2)
        # One behind the other's middle.
        np.testing.assert_allclose(grid.mean(axis=0)[1:], [-0.29, 0.89], atol=1e-12)
    assert goals[:, 0].min() > SHIPPED.upper[0] + SHIPPED.radius_m


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.integers(1, 6), st.floats(0.1, 0.4), st.floats(0.005, 0.05), st.data())
def test_a_board_is_closed_but_for_its_open_apertures(
    rows: int, columns: int, aperture_m: float, bar_m: float, data: st.DataObject
) -> None:
    board = ApertureBoard(rows=rows, columns=columns, aperture_m=aperture_m, bar_m=bar_m)
    n = rows * columns
    blocked = data.draw(st.lists(st.integers(0, n - 1), unique=True, max_size=n - 1))
    instance = board.blocked_board(np.array(blocked, dtype=int))
    assert instance.p_WA is not None
    assert len(instance.p_WA) == n - len(blocked)
    half = 0.5 * np.array([columns * aperture_m + bar_m, rows * aperture_m + bar_m])
    across = np.random.default_rng(0).uniform(-half, half, (2000, 2))
    p_WQ = np.array(board.board_centre) + np.insert(across, 0, 0.0, axis=1)
    clear = 0.5 * (aperture_m - bar_m)
    offset = np.abs(p_WQ[:, None, 1:] - instance.p_WA[:, 1:]).max(axis=2).min(axis=1)
    np.testing.assert_array_equal(is_in_board(instance, p_WQ), offset >= clear)


def test_what_is_blocked_is_random_and_leaves_the_spheres_as_they_are() -> None:
    blocked = replace(SHIPPED, num_blocked=15, num_spheres=5)
    opened = np.array([sample(blocked, index).p_WA for index in range(100)])
    assert opened.shape == (100, 5, 3)
    centres = SHIPPED.aperture_centres()[:, None, None]
    counts = np.all(np.isclose(opened, centres), axis=3).sum(axis=(1, 2))
    assert counts.sum() == 500
    assert counts.min() >= 8  # 25 expected, standard deviation 4.3.
    assert counts.max() <= 42
    fewer = replace(blocked, num_blocked=0)
    np.testing.assert_array_equal(sample(blocked).p_WO[:5], sample(fewer).p_WO[:5])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rows": 21}, "rows must be from 1 to 20, got 21"),
        ({"bar_m": 0.2}, "bar_m must be below aperture_m"),
        ({"num_blocked": 20}, "num_blocked must be from 0 to 19, got 20"),
        ({"board_centre": [0.55, 0.0, 1.0]}, "would overlap the board"),
    ],
)
def test_values_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        replace(SHIPPED, **values)


def test_more_spheres_than_fit_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"of 300 objects fit into .* m\^3"):
        sample(replace(SHIPPED, num_spheres=300))
