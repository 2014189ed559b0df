from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from lic_drake.errors import LibraryError
from scripts.bounds.optima import (
    choose_bandwidth,
    held_out_score,
    one_start_score,
    random_rate,
)
from scripts.bounds.table import (
    Bound,
    Factorial,
    bounds_table,
    compute_bounds,
    load_factorial,
)

small = arrays(bool, st.tuples(st.integers(2, 4), st.integers(1, 3), st.integers(2, 5)))
COMMON = np.array([[0.5, -0.1], [0.5, 0.3]])


def common_goals(success: np.ndarray) -> np.ndarray:
    E, G, _ = success.shape
    return np.broadcast_to(np.column_stack([np.full(G, 0.5), 0.1 * np.arange(G)]), (E, G, 2))


def columns_of(success: np.ndarray, goals: np.ndarray) -> dict[str, np.ndarray[Any, Any]]:
    """Columns of a library of E environments (7, 9, ...), in a random order."""
    e, g, s = (index.ravel() for index in np.indices(success.shape))
    order = np.random.default_rng(0).permutation(success.size)
    columns = {
        "category": np.full(success.size, "cylinder-clutter", dtype=object),
        "environment": 7 + 2 * e,
        "goal_x": goals[e, g, 0],
        "goal_y": goals[e, g, 1],
        "start_x": np.full(success.size, 0.3),
        "start_y": 0.1 * s,
        "start_phi": np.zeros(success.size),
        "base_y": np.zeros(success.size),
        "success": success.ravel(),
    }
    return {name: values[order] for name, values in columns.items()}


def factorial(success: np.ndarray, goals: np.ndarray | None = None) -> Factorial:
    return load_factorial(columns_of(success, common_goals(success) if goals is None else goals))


def rates(bounds: list[Bound]) -> dict[tuple[str, int], float]:
    return {(bound.name, bound.attempts): bound.rate for bound in bounds}


@given(small, st.integers(1, 2))
def test_rnd_is_the_mean_over_all_sequences_of_starts(success: np.ndarray, attempts: int) -> None:
    sequences = list(product(range(success.shape[2]), repeat=attempts))
    expected = np.mean([success[:, :, list(s)].any(axis=2) for s in sequences], axis=0)
    rate = random_rate(success, np.ones_like(success), attempts)
    np.testing.assert_allclose(rate, expected, atol=1e-12)


@given(small)
def test_the_bandwidth_goes_from_the_goal_itself_to_all_goals_alike(success: np.ndarray) -> None:
    narrow, wide = (held_out_score(success, common_goals(success), h) for h in (0.002, 1e4))
    for e in range(len(success)):
        others = np.delete(success, e, axis=0)
        np.testing.assert_allclose(narrow[e], others.mean(axis=0), atol=1e-9)
        np.testing.assert_allclose(wide[e] - others.mean(axis=(0, 1)), 0.0, atol=1e-6)
    np.testing.assert_allclose(wide, one_start_score(success), atol=1e-6)


@pytest.mark.parametrize(("width", "smallest", "largest"), [(0.02, 0.0, 0.03), (10.0, 0.1, 1.0)])
def test_the_bandwidth_follows_how_fast_success_changes_with_the_goal(
    width: float, smallest: float, largest: float
) -> None:
    rng = np.random.default_rng(4)
    y = rng.uniform(-0.2, 0.2, 400)
    probability = 0.5 + 0.45 * np.sin(y[:, None] / width + np.array([0.0, 2.0, 4.0]))
    success = (rng.random((400, 3)) < probability)[:, None]
    goals = np.column_stack([np.full(400, 0.7), y])[:, None]
    assert smallest < choose_bandwidth(success, goals) < largest


def test_rows_find_their_places_whatever_their_order() -> None:
    success = np.random.default_rng(3).random((4, 2, 3)) < 0.5
    found = factorial(success, np.broadcast_to(COMMON, (4, 2, 2)))
    np.testing.assert_array_equal(found.success, success)
    np.testing.assert_array_equal(found.goals[3], COMMON)
    np.testing.assert_array_equal(found.arrange(found.columns["success"]), success)


def test_reaches_that_are_missing_or_there_twice_are_refused() -> None:
    columns = columns_of(np.ones((3, 2, 3), dtype=bool), np.broadcast_to(COMMON, (3, 2, 2)))
    with pytest.raises(LibraryError, match=r"got 3 with \[2\] goals and \[2, 3\] starts"):
        load_factorial({name: values[1:] for name, values in columns.items()})
    with pytest.raises(LibraryError, match="some were tried twice"):
        load_factorial({name: np.append(v, v[:1]) for name, v in columns.items()})


def test_where_each_goal_has_its_start_the_population_optimum_is_the_oracle() -> None:
    # Start g reaches goal g, always, and no other start does.
    success = np.broadcast_to(np.eye(4, dtype=bool)[:3], (5, 3, 4))
    bounds = compute_bounds(factorial(success))
    assert rates(bounds) == pytest.approx(
        {
            ("RND", 1): 0.25,
            ("one start for all goals, held out", 1): 1 / 3,
            ("best start for each goal, held out", 1): 1.0,
            ("best start for each goal, in sample", 1): 1.0,
            ("oracle", 1): 1.0,
            ("RND", 2): 1.0 - 0.75**2,
            ("best pair for each goal, held out", 2): 1.0,
            ("best pair for each goal, in sample", 2): 1.0,
            ("oracle", 2): 1.0,
        }
    )


def test_the_table_says_which_share_of_each_bound_a_strategy_attains() -> None:
    def bound(name: str, attempts: int, *rate: float) -> Bound:
        return Bound(name=name, attempts=attempts, by_environment=np.array(rate))

    bounds = [bound("RND", 1, 0.2, 0.2), bound("oracle", 1, 1.0, 0.5), bound("oracle", 2, 1.0, 1.0)]
    gp = {("LIC(GP)", 1): bound("LIC(GP), discrete starts", 1, 0.8, 0.4)}
    rows = [row for row in bounds_table(bounds, gp, "a category").rows if row]
    assert [row[1] for row in rows] == ["RND", "LIC(GP), discrete starts", "oracle", "oracle"]
    # Four fifths in each environment, hence in every sample of them.
    assert rows[2] == ("1", "oracle", "75.0", "50.0..100.0", "80 (80..80)")
    assert rows[3][4] == ""


def test_where_the_environment_decides_only_the_oracle_gains() -> None:
    # In environment e start e succeeds: what succeeded elsewhere fails here.
    success = np.broadcast_to(np.eye(5, dtype=bool)[:, None], (5, 2, 5))
    found = rates(compute_bounds(factorial(success)))
    assert found["oracle", 1] == 1.0
    assert found["best start for each goal, held out", 1] == 0.0
    assert found["best start for each goal, in sample", 1] == pytest.approx(0.2)
