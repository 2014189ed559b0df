from typing import Any

import numpy as np
import pytest

from lic_drake.errors import LibraryError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from scripts.bounds.factorial import load_factorial

STARTS = np.array([[0.3, -0.1, 0.0], [0.3, -0.1, 0.5], [0.3, 0.2, 0.0]])
COMMON = np.array([[0.5, -0.1], [0.5, 0.3]])


def columns_of(success: np.ndarray, goals: np.ndarray) -> dict[str, np.ndarray[Any, Any]]:
    """Columns of a library of E environments (7, 9, ...), in a random order."""
    e, g, s = (index.ravel() for index in np.indices(success.shape))
    order = np.random.default_rng(0).permutation(success.size)
    columns = {
        "stream": np.full(success.size, "holdout", dtype=object),
        "environment": 7 + 2 * e,
        "goal_x": goals[e, g, 0],
        "goal_y": goals[e, g, 1],
        "start_x": STARTS[s, 0],
        "start_y": STARTS[s, 1],
        "start_phi": STARTS[s, 2],
        "success": success.ravel(),
    }
    return {name: values[order] for name, values in columns.items()}


def outcomes(environments: int, goals: int) -> np.ndarray:
    return np.random.default_rng(3).random((environments, goals, 3)) < 0.5


def test_rows_find_their_places_whatever_their_order() -> None:
    success = outcomes(4, 2)
    factorial = load_factorial(columns_of(success, np.broadcast_to(COMMON, (4, 2, 2))))
    np.testing.assert_array_equal(factorial.success, success)
    np.testing.assert_array_equal(factorial.starts, STARTS)
    np.testing.assert_array_equal(factorial.goals, np.broadcast_to(COMMON, (4, 2, 2)))
    assert factorial.has_common_goals


def test_each_environment_may_have_its_own_goal() -> None:
    goals = np.array([[[0.7, 0.2]], [[0.7, -0.1]], [[0.7, 0.1]]])
    success = outcomes(3, 1)
    factorial = load_factorial(columns_of(success, goals))
    np.testing.assert_array_equal(factorial.success, success)
    np.testing.assert_array_equal(factorial.goals, goals)
    assert not factorial.has_common_goals


def test_a_missing_reach_is_named() -> None:
    columns = columns_of(outcomes(3, 2), np.broadcast_to(COMMON, (3, 2, 2)))
    drop = (
        (columns["environment"] == 9) & (columns["goal_y"] == 0.3) & (columns["start_phi"] == 0.5)
    )
    with pytest.raises(LibraryError, match="environment 9, goal 1, start 1 was reached 0 times"):
        load_factorial({name: values[~drop] for name, values in columns.items()})


def test_a_reach_that_is_there_twice_is_named() -> None:
    columns = columns_of(outcomes(3, 2), np.broadcast_to(COMMON, (3, 2, 2)))
    twice = {name: np.append(values, values[:1]) for name, values in columns.items()}
    with pytest.raises(LibraryError, match="reached 2 times"):
        load_factorial(twice)


def test_environments_need_the_same_number_of_goals() -> None:
    columns = columns_of(outcomes(3, 2), np.broadcast_to(COMMON, (3, 2, 2)))
    drop = (columns["environment"] == 11) & (columns["goal_y"] == 0.3)
    with pytest.raises(LibraryError, match="environment 11 has 1 goals and environment 7 has 2"):
        load_factorial({name: values[~drop] for name, values in columns.items()})


def test_seed_streams_do_not_mix() -> None:
    columns = columns_of(outcomes(3, 2), np.broadcast_to(COMMON, (3, 2, 2)))
    columns["stream"][0] = "training"
    with pytest.raises(LibraryError, match="one seed stream, got holdout, training"):
        load_factorial(columns)


@pytest.mark.parametrize(
    ("category", "shape"), [("cylinder-clutter", (20, 45, 21)), ("passage-clutter", (120, 1, 14))]
)
def test_the_shipped_libraries_are_factorials(category: str, shape: tuple[int, int, int]) -> None:
    columns = ExperienceLibrary(shipped_library(category)).columns()
    factorial = load_factorial(columns)
    assert factorial.success.shape == shape
    assert factorial.has_common_goals == (category == "cylinder-clutter")
    assert factorial.success.sum() == columns["success"].sum()
