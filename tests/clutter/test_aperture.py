from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from scipy.stats import ks_2samp
from support.worlds import corners

from lic_drake.clutter.aperture import MAX_APERTURES, CylinderApertureClutter
from lic_drake.clutter.cylinder import CylinderClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.seeds import make_generator


def sample(
    clutter: CylinderClutter, index: int = 0, stream: str = "training", purpose: str = "aperture"
) -> ClutterInstance:
    return clutter.sample(make_generator(stream, purpose, index))


def walls_of(instance: ClutterInstance) -> list[int]:
    return [i for i, shape in enumerate(instance.shape) if shape == "box"]


BARRIERS = st.builds(
    CylinderApertureClutter,
    num_movable=st.integers(0, 5),
    num_fixed=st.integers(0, 5),
    barrier_x_m=st.floats(0.1, 0.34),
    barrier_length_m=st.floats(1.7, 4.0),
    barrier_thickness_m=st.floats(1e-3, 0.03),
    num_apertures=st.integers(1, 3),
    aperture_width_m=st.floats(0.02, 0.1),
    aperture_y_min_m=st.floats(-0.7, -0.3),
    aperture_y_max_m=st.floats(0.3, 0.7),
)


@settings(max_examples=60)
@given(BARRIERS, st.integers(0, 2**32 - 1))
def test_the_barriers_parts_tile_its_line_but_for_the_openings(
    clutter: CylinderApertureClutter, index: int
) -> None:
    instance = sample(clutter, index)
    assert instance.p_WA is not None
    assert instance.p_WA.shape == (clutter.num_apertures, 3)
    walls = walls_of(instance)
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
    openings = [(ends[k][1], ends[k + 1][0]) for k in range(len(ends) - 1)]
    assert all(high > low for low, high in ends)
    low, high = np.array(openings).T
    np.testing.assert_allclose(high - low, clutter.aperture_width_m, atol=1e-12)
    centres = instance.p_WA[np.argsort(instance.p_WA[:, 1])]
    np.testing.assert_allclose(0.5 * (low + high), centres[:, 1], atol=1e-12)
    np.testing.assert_array_equal(centres[:, 0], clutter.barrier_x_m)
    np.testing.assert_array_equal(centres[:, 2], 0.0)
    assert np.all(centres[:, 1] >= clutter.aperture_y_min_m)
    assert np.all(centres[:, 1] <= clutter.aperture_y_max_m)
    assert np.all(np.diff(centres[:, 1]) >= 2.0 * clutter.aperture_width_m - 1e-12)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_cylinders_stand_behind_the_barrier_and_do_not_overlap(index: int) -> None:
    clutter = CylinderApertureClutter()
    instance = sample(clutter, index)
    cylinders = np.array(instance.shape) == "cylinder"
    assert cylinders.sum() == clutter.num_movable + clutter.num_fixed
    assert np.count_nonzero(instance.movable) == clutter.num_movable
    p = instance.p_WO[cylinders]
    assert pdist(p[:, :2]).min() >= 2.0 * clutter.radius_m - 1e-12
    behind = clutter.barrier_x_m + 0.5 * clutter.barrier_thickness_m
    assert np.all(p[:, 0] - clutter.radius_m >= behind)


def test_the_cylinders_are_those_of_cylinder_clutter() -> None:
    with_barrier, without = CylinderApertureClutter(), CylinderClutter()
    for index in range(20):
        expected = sample(without, index)
        instance = sample(with_barrier, index)
        n = expected.num_objects
        np.testing.assert_array_equal(instance.p_WO[:n], expected.p_WO)
        np.testing.assert_array_equal(instance.size[:n], expected.size)
        np.testing.assert_array_equal(instance.mass[:n], expected.mass)
        np.testing.assert_array_equal(instance.movable[:n], expected.movable)


def test_the_centres_of_openings_are_uniform_but_for_their_distance() -> None:
    one = CylinderApertureClutter(num_apertures=1, num_movable=0, num_fixed=0)
    y = [sample(one, index).p_WA[0, 1] for index in range(1500)]
    uniform = np.linspace(one.aperture_y_min_m, one.aperture_y_max_m, 5000)
    assert ks_2samp(y, uniform).pvalue > 1e-3
    # Of three, whole triples that are too near are not drawn; the mean stays in the middle.
    three = CylinderApertureClutter(num_movable=0, num_fixed=0)
    y = np.array([sample(three, index).p_WA[:, 1] for index in range(500)])
    assert abs(y.mean()) < 0.03
    assert y.std() > 0.3


def test_an_index_always_gives_the_same_barrier_and_another_one_gives_another() -> None:
    clutter = CylinderApertureClutter()
    np.testing.assert_array_equal(sample(clutter, 3).p_WA, sample(clutter, 3).p_WA)
    others = [sample(clutter, 4), sample(clutter, 3, "evaluation")]
    assert all(np.all(sample(clutter, 3).p_WA[:, 1] != other.p_WA[:, 1]) for other in others)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_apertures": 0}, "num_apertures must be from 1 to 50, got 0"),
        ({"num_apertures": MAX_APERTURES + 1}, "num_apertures must be from 1 to 50, got 51"),
        ({"barrier_length_m": 0.0}, "barrier_length_m must be a positive number, got 0.0"),
        ({"barrier_thickness_m": -0.1}, "barrier_thickness_m must be a positive number, got -0.1"),
        ({"aperture_width_m": float("nan")}, "aperture_width_m must be a positive number, got nan"),
        ({"barrier_x_m": float("inf")}, "finite barrier_x_m, got inf"),
        ({"aperture_y_min_m": 0.7}, "aperture_y_min_m <= aperture_y_max_m, got 0.7 and 0.6"),
        ({"aperture_y_max_m": float("nan")}, "got -0.6 and nan"),
        ({"barrier_length_m": 1.3}, "do not fit into a barrier of 1.3 m; give it a larger"),
        ({"aperture_y_min_m": -1.55}, "apertures at y -1.55 to 0.6 do not fit into a barrier"),
        ({"barrier_x_m": 0.36}, "cylinders from x = 0.360 m on would stand in the barrier at 0.36"),
        ({"radius_m": 0.03}, "cylinders from x = 0.340 m on would stand in the barrier"),
        ({"num_fixed": -1}, "num_fixed must be from 0 to 2000, got -1"),
    ],
)
def test_a_value_that_cannot_be_used_is_named(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message.replace("(", r"\(")):
        CylinderApertureClutter(**values)


def test_openings_that_do_not_fit_beside_each_other_are_refused() -> None:
    clutter = CylinderApertureClutter(num_apertures=8, num_movable=0, num_fixed=0)
    with pytest.raises(ScenarioError, match="of 8 objects fit into"):
        sample(clutter)
