from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from scipy.stats import kstest
from support.worlds import corners

from lic_drake.clutter.cylinder import CylinderApertureClutter, CylinderClutter
from lic_drake.clutter.instance import ClutterInstance, place_discs
from lic_drake.errors import ScenarioError
from lic_drake.seeds import make_generator


def sample(clutter: CylinderClutter, stream: str = "training", index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator(stream, "cylinder-clutter", index))


def test_the_defaults_are_the_papers_field() -> None:
    instance = sample(CylinderClutter())
    assert instance.shape == ("cylinder",) * 80
    assert np.count_nonzero(instance.movable) == 40
    np.testing.assert_array_equal(instance.size, np.tile([0.01, 0.2, 0.0], (80, 1)))
    np.testing.assert_array_equal(instance.mass, 1.0)
    extent = np.subtract(CylinderClutter().upper, CylinderClutter().lower)
    np.testing.assert_allclose(extent, [0.65, 2.4], atol=1e-12)


# Sparse enough that rejection always succeeds: 60 discs of 0.02 m radius cover 0.075 m^2.
FIELDS = st.builds(
    CylinderClutter,
    num_movable=st.integers(0, 30),
    num_fixed=st.integers(0, 30),
    radius_m=st.floats(1e-3, 0.02),
    lower=st.tuples(st.floats(-2.0, 0.0), st.floats(-2.0, 0.0)).map(list),
    upper=st.tuples(st.floats(0.8, 2.0), st.floats(0.8, 2.0)).map(list),
)


@settings(max_examples=50)
@given(FIELDS, st.integers(0, 2**32 - 1))
def test_any_field_has_its_counts_stays_in_its_bounds_and_does_not_overlap(
    clutter: CylinderClutter, index: int
) -> None:
    instance = sample(clutter, index=index)
    n = clutter.num_movable + clutter.num_fixed
    assert instance.num_objects == n
    assert np.count_nonzero(instance.movable) == clutter.num_movable
    assert np.all(instance.p_WO[:, :2] >= clutter.lower)
    assert np.all(instance.p_WO[:, :2] <= clutter.upper)
    np.testing.assert_array_equal(instance.p_WO[:, 2], 0.0)
    if n > 1:
        assert pdist(instance.p_WO[:, :2]).min() >= 2.0 * clutter.radius_m * (1.0 - 1e-12)


def test_centres_are_uniform_over_the_rectangle_for_fixed_and_movable_alike() -> None:
    clutter = CylinderClutter()
    fields = [sample(clutter, index=index) for index in range(100)]
    for movable in (True, False):
        p = np.vstack([field.p_WO[field.movable == movable, :2] for field in fields])
        unit = (p - clutter.lower) / np.subtract(clutter.upper, clutter.lower)
        for axis in (0, 1):
            assert kstest(unit[:, axis], "uniform").pvalue > 1e-3
        assert abs(np.corrcoef(unit.T)[0, 1]) < 0.07  # 4000 draws: 4.4 standard deviations.


def test_discs_are_drawn_one_after_the_other_until_no_more_fit() -> None:
    few = place_discs(np.random.default_rng(5), 10, [0, 0], [1, 1], 0.05)
    many = place_discs(np.random.default_rng(5), 40, [0, 0], [1, 1], 0.05)
    np.testing.assert_array_equal(few, many[:10])
    with pytest.raises(ScenarioError, match=r"only 1 of 2 objects fit into 1 m\^2 at .* 2 m; use"):
        place_discs(np.random.default_rng(0), 2, [0, 0], [1, 1], 2.0)


BARRIERS = st.builds(
    CylinderApertureClutter,
    num_movable=st.integers(0, 5),
    num_fixed=st.integers(0, 5),
    barrier_x_m=st.floats(0.1, 0.34),
    barrier_length_m=st.floats(1.7, 4.0),
    barrier_thickness_m=st.floats(1e-3, 0.03),
    num_apertures=st.integers(1, 5),
    aperture_width_m=st.floats(0.02, 0.07),
    aperture_y_min_m=st.floats(-0.7, -0.3),
    aperture_y_max_m=st.floats(0.3, 0.7),
)


@settings(max_examples=60)
@given(BARRIERS, st.integers(0, 2**32 - 1))
def test_the_barriers_parts_tile_its_line_but_for_the_openings(
    clutter: CylinderApertureClutter, index: int
) -> None:
    instance = sample(clutter, index=index)
    walls = [i for i, shape in enumerate(instance.shape) if shape == "box"]
    assert not instance.movable[walls].any()
    ends = []
    for i in walls:
        x, y = corners(instance, i).T
        half = 0.5 * clutter.barrier_thickness_m
        assert x.min() == pytest.approx(clutter.barrier_x_m - half, abs=1e-12)
        assert x.max() == pytest.approx(clutter.barrier_x_m + half, abs=1e-12)
        ends.append((y.min(), y.max()))
    ends.sort()
    # From end to end: part, opening, part, ..., part.
    half = 0.5 * clutter.barrier_length_m
    assert ends[0][0] == pytest.approx(-half, abs=1e-12)
    assert ends[-1][1] == pytest.approx(half, abs=1e-12)
    low, high = np.array([(ends[k][1], ends[k + 1][0]) for k in range(len(ends) - 1)]).T
    np.testing.assert_allclose(high - low, clutter.aperture_width_m, atol=1e-12)
    p_WA = instance.p_WA
    assert p_WA is not None and p_WA.shape == (clutter.num_apertures, 3)
    np.testing.assert_allclose(0.5 * (low + high), p_WA[:, 1], atol=1e-12)
    np.testing.assert_array_equal(p_WA[:, [0, 2]], [[clutter.barrier_x_m, 0.0]] * len(p_WA))
    assert np.all(p_WA[:, 1] >= clutter.aperture_y_min_m)
    assert np.all(p_WA[:, 1] <= clutter.aperture_y_max_m + 1e-12)
    assert np.all(np.diff(p_WA[:, 1]) >= 2.0 * clutter.aperture_width_m - 1e-12)


def test_the_cylinders_behind_a_barrier_are_those_of_cylinder_clutter() -> None:
    clutter = CylinderApertureClutter()
    for index in range(20):
        expected, instance = sample(CylinderClutter(), index=index), sample(clutter, index=index)
        n = expected.num_objects
        for name in ("p_WO", "size", "mass", "movable"):
            np.testing.assert_array_equal(getattr(instance, name)[:n], getattr(expected, name))
        behind = clutter.barrier_x_m + 0.5 * clutter.barrier_thickness_m
        assert np.all(instance.p_WO[:n, 0] - clutter.radius_m >= behind)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_movable": -1}, "num_movable must be from 0 to 2000, got -1"),
        ({"upper": [1.02, -1.3]}, "lower must not exceed upper"),
        ({"aperture_y_min_m": 0.7}, "aperture_y_min_m must not exceed aperture_y_max_m"),
        ({"barrier_length_m": 1.3}, "do not fit into a barrier of 1.3 m; increase"),
        ({"num_apertures": 8}, "8 apertures need 1.4 m between .* use fewer or narrower"),
        ({"barrier_x_m": 0.36}, "cylinders from x = 0.360 m would overlap the barrier at 0.36"),
    ],
)
def test_a_value_that_cannot_be_used_is_named(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        CylinderApertureClutter(**values)
