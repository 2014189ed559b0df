from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import pdist
from scipy.stats import kstest

from lic_drake.clutter.cylinder import MAX_OBJECTS, CylinderClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.seeds import STREAMS, make_generator


def sample(clutter: CylinderClutter, stream: str = "training", index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator(stream, "cylinder-clutter", index))


def test_the_defaults_are_the_papers_field() -> None:
    instance = sample(CylinderClutter())
    assert instance.num_objects == 80
    assert np.count_nonzero(instance.movable) == 40
    assert set(instance.shape) == {"cylinder"}
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
    length_m=st.floats(0.01, 1.0),
    mass_kg=st.floats(1e-2, 10.0),
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
    np.testing.assert_array_equal(instance.size[:, 0], clutter.radius_m)
    np.testing.assert_array_equal(instance.size[:, 1], clutter.length_m)
    np.testing.assert_array_equal(instance.mass, clutter.mass_kg)
    if n > 1:
        assert pdist(instance.p_WO[:, :2]).min() >= 2.0 * clutter.radius_m * (1.0 - 1e-12)


def test_an_index_always_gives_the_same_field_and_another_one_gives_another() -> None:
    clutter = CylinderClutter()
    first = sample(clutter, index=3)
    np.testing.assert_array_equal(first.p_WO, sample(clutter, index=3).p_WO)
    fields = [sample(clutter, stream, index).p_WO for stream in STREAMS for index in (3, 4)]
    centres = np.vstack(fields)
    assert len(np.unique(centres, axis=0)) == len(centres)


def test_centres_are_uniform_over_the_rectangle_for_fixed_and_movable_alike() -> None:
    clutter = CylinderClutter()
    fields = [sample(clutter, index=index) for index in range(100)]
    for movable in (True, False):
        p = np.vstack([field.p_WO[field.movable == movable, :2] for field in fields])
        unit = (p - clutter.lower) / np.subtract(clutter.upper, clutter.lower)
        for axis in (0, 1):
            assert kstest(unit[:, axis], "uniform").pvalue > 1e-3
        assert abs(np.corrcoef(unit.T)[0, 1]) < 0.07  # 4000 draws: 4.4 standard deviations.


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"num_movable": -1}, "num_movable must be from 0 to 2000, got -1"),
        ({"num_fixed": MAX_OBJECTS + 1}, "num_fixed must be from 0 to 2000, got 2001"),
        ({"radius_m": 0.0}, "radius_m must be a positive number, got 0.0"),
        ({"radius_m": float("nan")}, "radius_m must be a positive number, got nan"),
        ({"length_m": -0.2}, "length_m must be a positive number, got -0.2"),
        ({"length_m": float("inf")}, "length_m must be a positive number, got inf"),
        ({"mass_kg": 0.0}, "mass_kg must be a positive number, got 0.0"),
        ({"lower": [0.1]}, r"lower and upper must be \[x, y\]"),
        ({"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}, r"must be \[x, y\]"),
        ({"upper": [1.0, float("inf")]}, r"must be \[x, y\] in metres.*inf"),
        ({"lower": [2.0, -1.0]}, r"lower \[2.0, -1.0\] must be below upper \[1.02, 1.2\]"),
        ({"upper": [1.02, -1.2]}, r"must be below upper \[1.02, -1.2\]"),
    ],
)
def test_a_value_that_cannot_be_used_is_named(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        CylinderClutter(**values)


def test_a_field_too_dense_says_how_many_fitted_and_what_to_do() -> None:
    clutter = CylinderClutter(
        num_movable=0, num_fixed=40, radius_m=0.1, lower=[0.0, 0.0], upper=[0.5, 0.5]
    )
    with pytest.raises(ScenarioError, match=r"only (\d+) of 40 objects fit") as caught:
        sample(clutter)
    assert "use fewer or smaller objects or a larger region" in str(caught.value)
