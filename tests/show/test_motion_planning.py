from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lic_drake.show.motion_planning import CHECKED_RAD, is_path_free, plan_motion

LOW, HIGH = np.full(2, -1.0), np.full(2, 1.0)
LEFT, RIGHT = np.array([-0.8, 0.0]), np.array([0.8, 0.0])


def wall_with_a_gap(gap: float) -> object:
    """A wall along the second axis that only y > 1 - gap passes."""
    return lambda q: abs(q[0]) > 0.1 or q[1] > 1.0 - gap


@settings(max_examples=20, deadline=None)
@given(gap=st.floats(0.2, 1.9), seed=st.integers(0, 99))
def test_a_path_leads_from_one_end_to_the_other_and_is_free(gap: float, seed: int) -> None:
    is_free = wall_with_a_gap(gap)
    path = plan_motion(is_free, LOW, HIGH, LEFT, RIGHT, np.random.default_rng(seed))  # type: ignore[arg-type]
    assert path is not None
    np.testing.assert_array_equal(path[[0, -1]], [LEFT, RIGHT])
    for a, b in pairwise(path):
        # Looked at twice as closely as the planner does; a corner may be cut by less than that.
        q = np.linspace(a, b, 2 + int(2 * np.abs(b - a).max() / CHECKED_RAD))
        assert np.mean([wall_with_a_gap(gap + 0.03)(row) for row in q]) == 1.0  # type: ignore[operator]
    assert np.all((path >= LOW) & (path <= HIGH))


def test_a_straight_line_is_taken_where_it_is_free() -> None:
    rng = np.random.default_rng(0)
    path = plan_motion(lambda _: True, LOW, HIGH, LEFT, RIGHT, rng)
    np.testing.assert_array_equal(path, [LEFT, RIGHT])


def test_where_nothing_leads_there_it_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lic_drake.show.motion_planning.MAX_NODES", 200)
    rng = np.random.default_rng(0)
    assert plan_motion(lambda q: abs(q[0]) > 0.1, LOW, HIGH, LEFT, RIGHT, rng) is None


def test_a_thin_obstacle_on_a_line_is_found() -> None:
    assert not is_path_free(lambda q: abs(q[0]) > CHECKED_RAD, LEFT, RIGHT)
    assert is_path_free(lambda q: q[0] > LEFT[0], LEFT, RIGHT)
