from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.sphere import SphereApertureClutter
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator

SCENARIO = load_scenario("sphere-aperture-clutter")
assert isinstance(SCENARIO.clutter, SphereApertureClutter)
SHIPPED = SCENARIO.clutter


def sample(clutter: SphereApertureClutter, index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator("training", "spheres", index))


def is_in_board(instance: ClutterInstance, p_WQ: np.ndarray) -> np.ndarray:
    """Tells which points lie in one of the instance's boxes."""
    boxes = ~instance.movable
    inside = np.abs(p_WQ[:, None] - instance.p_WO[boxes]) <= 0.5 * instance.size[boxes] + 1e-12
    return np.any(np.all(inside, axis=2), axis=1)


def test_the_shipped_scenario_has_the_papers_numbers() -> None:
    assert SHIPPED == SphereApertureClutter()
    instance = sample(SHIPPED)
    assert np.count_nonzero(instance.movable) == 40
    np.testing.assert_array_equal(instance.size[instance.movable, 0], 0.05)
    np.testing.assert_array_equal(instance.mass[instance.movable], 0.1)
    assert instance.num_axes == 3
    box = np.array(SHIPPED.upper) - SHIPPED.lower
    np.testing.assert_allclose(box + [2.0 * 0.05, 0.0, 0.0], [0.29, 0.7, 0.4])


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
    spheres = np.array(SHIPPED.upper)[0] + SHIPPED.radius_m
    assert goals[:, 0].min() > spheres
    for index in range(5):
        goal = SCENARIO.sample_goal("evaluation", 0, index)
        assert np.all(goal >= goals.min(axis=0) - 1e-12)
        assert np.all(goal <= goals.max(axis=0) + 1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_spheres_lie_in_their_box_without_overlap(index: int) -> None:
    instance = sample(SHIPPED, index)
    p_WO = instance.p_WO[instance.movable]
    assert np.all(p_WO >= SHIPPED.lower)
    assert np.all(p_WO <= SHIPPED.upper)
    assert pdist(p_WO).min() >= 0.1


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.integers(1, 6), st.floats(0.1, 0.4), st.floats(0.005, 0.05), st.data())
def test_a_board_is_closed_but_for_its_open_apertures(
    rows: int, columns: int, aperture_m: float, bar_m: float, data: st.DataObject
) -> None:
    clutter = SphereApertureClutter(
        num_spheres=0,
        lower=[0.62, -0.64, 0.69],  # Behind the thickest bars.
        rows=rows,
        columns=columns,
        aperture_m=aperture_m,
        bar_m=bar_m,
        num_blocked=data.draw(st.integers(0, rows * columns - 1)),
    )
    instance = sample(clutter, data.draw(st.integers(0, 1000)))
    assert instance.p_WA is not None
    assert len(instance.p_WA) == rows * columns - clutter.num_blocked
    half = 0.5 * np.array([columns * aperture_m + bar_m, rows * aperture_m + bar_m])
    across = np.random.default_rng(0).uniform(-half, half, (2000, 2))
    p_WQ = np.array(clutter.board_centre) + np.insert(across, 0, 0.0, axis=1)
    clear = 0.5 * (aperture_m - bar_m)
    offset = np.abs(p_WQ[:, None, 1:] - instance.p_WA[:, 1:]).max(axis=2).min(axis=1)
    np.testing.assert_array_equal(is_in_board(instance, p_WQ), offset >= clear)


def test_what_is_blocked_is_random_and_leaves_the_spheres_as_they_are() -> None:
    blocked = replace(SHIPPED, num_blocked=15)
    opened = [sample(blocked, index).p_WA for index in range(200)]
    assert all(centres is not None and len(centres) == 5 for centres in opened)
    counts = [
        sum(bool(np.any(np.all(np.isclose(c, centre), axis=1))) for c in opened if c is not None)
        for centre in SHIPPED.aperture_centres()
    ]
    assert sum(counts) == 1000
    assert 25 <= min(counts)  # 50 expected, standard deviation 6.1.
    assert max(counts) <= 75
    np.testing.assert_array_equal(sample(blocked).p_WO[:40], sample(SHIPPED).p_WO[:40])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_spheres": -1}, "num_spheres must be from 0"),
        ({"radius_m": 0.0}, "radius_m must be a positive number"),
        ({"lower": [0.0, 0.0]}, r"lower must be \[x, y, z\]"),
        ({"upper": [0.78, 0.06, 0.69]}, "must be below upper"),
        ({"rows": 0}, "rows must be from 1 to 20"),
        ({"bar_m": 0.2}, "leave nothing of apertures"),
        ({"num_blocked": 20}, "must leave one of 20 apertures open"),
        ({"board_centre": [0.55, 0.0, 1.0]}, "would stand in the board"),
    ],
)
def test_values_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        replace(SHIPPED, **values)


@pytest.mark.parametrize("num_blocked", [0, 7])
def test_a_bare_board_is_what_all_environments_have_but_for_spheres_and_blocks(
    num_blocked: int,
) -> None:
    clutter = replace(SHIPPED, num_blocked=num_blocked)
    bare = clutter.bare_board()
    assert not bare.movable.any()
    np.testing.assert_array_equal(bare.p_WA, clutter.aperture_centres())
    open_board = sample(replace(SHIPPED, num_spheres=0))
    np.testing.assert_array_equal(bare.p_WO, open_board.p_WO)
    np.testing.assert_array_equal(bare.size, open_board.size)
    # Blocks only add to it.
    drawn = {(*p_WO, *size) for p_WO, size in zip(*_boxes(sample(clutter)), strict=True)}
    known = {(*p_WO, *size) for p_WO, size in zip(*_boxes(bare), strict=True)}
    assert known <= drawn
    assert len(drawn) == len(known) + num_blocked


def _boxes(instance: ClutterInstance) -> tuple[np.ndarray, np.ndarray]:
    return instance.p_WO[~instance.movable], instance.size[~instance.movable]


def test_too_many_spheres_do_not_fit() -> None:
    with pytest.raises(ScenarioError, match=r"of 300 objects fit into .* m\^3"):
        sample(replace(SHIPPED, num_spheres=300))
