from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist

from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.clutter.instance import ClutterInstance, Stems
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator

SHIPPED = FoliageApertureClutter()
SPARSE = replace(SHIPPED, num_stems=6, num_branches=2, leaves_per_stem=3)


def sample(clutter: FoliageApertureClutter, index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator("training", "foliage", index))


def stems_of(instance: ClutterInstance) -> Stems:
    assert instance.stems is not None
    return instance.stems


def leaf_corners(stems: Stems) -> np.ndarray:
    """Corners of all leaves in W, shape (8 k, 3)."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    p_SQ = stems.p_SL[:, None] + np.einsum(
        "kij,knj->kni", stems.R_SL, 0.5 * signs * stems.leaf_size[:, None]
    )
    R_WS, p_WH = stems.R_WS[stems.leaf_stem], stems.p_WH[stems.leaf_stem]
    return (p_WH[:, None] + np.einsum("kij,knj->kni", R_WS, p_SQ)).reshape(-1, 3)


def test_the_shipped_scenario_has_the_classs_defaults_and_the_papers_apertures() -> None:
    scenario = load_scenario("foliage-aperture-clutter")
    assert scenario.clutter == SHIPPED
    assert (SHIPPED.rows * SHIPPED.columns, SHIPPED.aperture_m) == (20, 0.2)
    instance = scenario.sample_instance("training", 0)
    assert instance.p_WA is not None
    assert len(instance.p_WA) == 20 - 6 - 2
    assert not instance.movable.any()
    assert stems_of(instance).num_stems == 46
    assert np.count_nonzero(stems_of(instance).fixed) == 6
    assert len(stems_of(instance).leaf_stem) == 46 * 9


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1))
def test_all_that_grows_stays_in_its_box_and_away_from_the_board(index: int) -> None:
    stems = stems_of(sample(SPARSE, index))
    tips = stems.p_WH + stems.length[:, None] * stems.R_WS[:, :, 2]
    for points in (stems.p_WH, tips, leaf_corners(stems)):
        assert np.all(points >= np.array(SPARSE.lower) - 1e-9)
        assert np.all(points <= np.array(SPARSE.upper) + 1e-9)
        assert points[:, 0].min() > SPARSE.board_back_m
    assert pdist(stems.p_WH[:, :2]).min() >= SPARSE.root_distance_m
    for R in (*stems.R_WS, *stems.R_SL):
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) == pytest.approx(1.0)


def test_stems_are_rooted_below_or_hang_from_above_and_slant_a_little() -> None:
    stems = stems_of(sample(SHIPPED))
    hangs = stems.p_WH[:, 2] == SHIPPED.upper[2]
    assert np.all(stems.p_WH[~hangs, 2] == SHIPPED.lower[2])
    assert 8 <= np.count_nonzero(hangs) <= 30  # 18.4 of 46 expected, standard deviation 3.3.
    up = np.where(hangs, -1.0, 1.0) * stems.R_WS[:, 2, 2]
    assert np.all(up >= np.cos(np.deg2rad(SHIPPED.max_slant_deg)) - 1e-12)
    # Leaves begin on their stem.
    begin = stems.p_SL - 0.5 * stems.leaf_size[:, :1] * stems.R_SL[:, :, 0]
    np.testing.assert_allclose(begin[:, :2], 0.0, atol=1e-12)
    assert np.all((begin[:, 2] > 0.0) & (begin[:, 2] <= stems.length[stems.leaf_stem]))


def test_a_stem_gives_way_at_its_tip_as_a_cantilever_of_its_wire() -> None:
    stems = stems_of(sample(SHIPPED))
    length, force = stems.length[~stems.fixed], 0.5
    wire_N_m2 = 200e9 * np.pi * 0.002**4 / 64.0
    cantilever = force * length**3 / (3.0 * wire_N_m2)
    hinge = force * length**2 / stems.stiffness[~stems.fixed]
    np.testing.assert_allclose(hinge, cantilever, rtol=0.02)


def is_covered(instance: ClutterInstance, p_WQ: np.ndarray) -> np.ndarray:
    inside = np.abs(p_WQ[:, None] - instance.p_WO) <= 0.5 * instance.size + 1e-12
    return np.any(np.all(inside, axis=2), axis=1)


@settings(max_examples=20)
@given(st.integers(0, 10), st.integers(0, 5), st.integers(0, 1000))
def test_the_instances_apertures_are_those_without_a_cover(
    blocked: int, partly: int, index: int
) -> None:
    clutter = replace(SPARSE, num_blocked=blocked, num_partly_covered=partly)
    instance = sample(clutter, index)
    assert instance.p_WA is not None
    assert instance.material.count("cardboard") == blocked + partly
    steps = np.linspace(-0.5, 0.5, 41) * (clutter.aperture_m - clutter.bar_m - 1e-6)
    offsets = np.stack(np.meshgrid(0.0, steps, steps), axis=-1).reshape(-1, 3)
    shares = [is_covered(instance, p + offsets).mean() for p in clutter.aperture_centres()]
    opened = [np.any(np.all(p == instance.p_WA, axis=1)) for p in clutter.aperture_centres()]
    np.testing.assert_array_equal(np.array(shares) == 0.0, opened)
    assert np.count_nonzero(np.array(shares) == 1.0) == blocked
    between = [share for share in shares if 0.0 < share < 1.0]
    assert len(between) == partly
    assert all(0.26 < share < 0.74 for share in between)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"leaves_per_stem": 51}, "leaves_per_stem must be from 0 to 50"),
        ({"leaf_length_m": [0.1, 0.05]}, r"leaf_length_m must be \[least, most\]"),
        ({"covered_share": [0.5, 1.1]}, "covered_share must be from 0 to 1"),
        ({"num_blocked": 18}, "num_partly_covered must be from 0 to 1, got 2"),
        ({"lower": [0.5, -0.6, 0.5]}, "would overlap the board"),
        ({"margin_m": 0.2}, "below half of the box's width"),
        ({"stem_length_m": [0.4, 1.0]}, "longer than the box"),
    ],
)
def test_values_that_make_no_sense_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        replace(SHIPPED, **values)
