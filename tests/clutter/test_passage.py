import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest
from support.worlds import corners

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.passage import PassageClutter
from lic_drake.errors import ScenarioError
from lic_drake.seeds import make_generator


def sample(passage: PassageClutter, index: int = 0) -> ClutterInstance:
    return passage.sample(make_generator("training", "passage-clutter", index))


def test_the_defaults_are_the_papers_passage() -> None:
    passage = PassageClutter()
    instance = sample(passage)
    assert instance.shape == ("box", "box")
    assert not instance.movable.any()
    np.testing.assert_array_equal(instance.size[:, :2], [[0.4, 0.02], [0.4, 0.02]])
    assert passage.gap_m == 0.1
    assert np.linalg.norm(np.subtract(passage.centre_to, passage.centre_from)) == 0.4


POINTS = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)).map(list)
PASSAGES = st.builds(
    PassageClutter,
    gap_m=st.floats(1e-3, 0.5),
    wall_length_m=st.floats(1e-2, 1.0),
    wall_width_m=st.floats(1e-3, 0.1),
    centre_from=POINTS,
    centre_to=POINTS,
    min_slope_deg=st.floats(-90.0, 10.0),
    max_slope_deg=st.floats(10.0, 90.0),
)


@given(PASSAGES, st.integers(0, 2**32 - 1))
def test_whatever_the_slope_the_gap_is_exact_and_the_goal_in_its_middle(
    passage: PassageClutter, index: int
) -> None:
    begin, end = passage.centre_from, passage.centre_to
    instance = sample(passage, index)
    # On the segment: the ways to both ends add up to its length.
    assert instance.p_WG is not None and instance.p_WG[2] == 0.0
    ways = np.linalg.norm(instance.p_WG[:2] - np.array([begin, end]), axis=1)
    assert ways.sum() == pytest.approx(np.linalg.norm(np.subtract(end, begin)), abs=1e-9)
    yaw = instance.yaw[0]
    assert passage.min_slope_deg - 1e-9 <= np.rad2deg(yaw) <= passage.max_slope_deg + 1e-9
    # Seen from the goal along the passage and across it.
    along, across = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    left, right = (corners(instance, i) - instance.p_WG[:2] for i in (0, 1))
    for wall in (left, right):
        assert np.ptp(wall @ along) == pytest.approx(passage.wall_length_m)
        assert np.ptp(wall @ across) == pytest.approx(passage.wall_width_m)
        assert (wall @ along).min() == pytest.approx(-0.5 * passage.wall_length_m)
    assert (left @ across).min() == pytest.approx(0.5 * passage.gap_m)
    assert (right @ across).max() == pytest.approx(-0.5 * passage.gap_m)


def test_centres_and_slopes_are_uniform_and_independent() -> None:
    passage = PassageClutter()
    drawn = [sample(passage, index) for index in range(2000)]
    y = np.array([instance.p_WG[1] for instance in drawn if instance.p_WG is not None])
    slope = np.rad2deg([instance.yaw[0] for instance in drawn])
    slopes = passage.max_slope_deg - passage.min_slope_deg
    assert kstest((y - passage.centre_from[1]) / 0.4, "uniform").pvalue > 1e-3
    assert kstest((slope - passage.min_slope_deg) / slopes, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(y, slope)[0, 1]) < 0.09  # 4 standard deviations
    with pytest.raises(ScenarioError, match="min_slope_deg must not exceed max_slope_deg, got 40"):
        PassageClutter(min_slope_deg=40.0)
