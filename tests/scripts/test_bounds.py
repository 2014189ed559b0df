from math import isnan

import numpy as np
import pytest

from lic_drake.errors import LibraryError
from scripts.bounds.bounds import Bound, bounds_table, compute_bounds, share_of_gap
from scripts.bounds.factorial import Factorial
from scripts.bounds.optima import random_rate


def factorial(success: np.ndarray, goals: np.ndarray | None = None) -> Factorial:
    E, G, S = success.shape
    if goals is None:
        goals = np.broadcast_to(np.column_stack([np.full(G, 0.5), 0.2 * np.arange(G)]), (E, G, 2))
    starts = np.column_stack([np.full(S, 0.335), np.linspace(-0.4, 0.4, S), np.zeros(S)])
    return Factorial(success=success, goals=goals, starts=starts)


def rates(bounds: list[Bound]) -> dict[tuple[str, int], float]:
    return {(bound.name, bound.attempts): bound.rate for bound in bounds}


def test_where_each_goal_has_its_start_the_population_optimum_is_the_oracle() -> None:
    # Start g reaches goal g, always, and no other start does.
    success = np.broadcast_to(np.eye(4, dtype=bool)[:3], (5, 3, 4))
    found = rates(compute_bounds(factorial(success)))
    assert found == pytest.approx(
        {
            ("RND", 1): 0.25,
            ("one start for all goals, held out", 1): 1 / 3,
            ("best start for each goal, held out", 1): 1.0,
            ("best start for each goal, in sample", 1): 1.0,
            ("oracle", 1): 1.0,
            ("RND", 2): 0.5,
            ("best pair for each goal, held out", 2): 1.0,
            ("best pair for each goal, in sample", 2): 1.0,
            ("oracle", 2): 1.0,
        }
    )


def test_where_the_environment_decides_only_the_oracle_gains() -> None:
    # In environment e start e succeeds: what succeeded elsewhere fails here.
    success = np.broadcast_to(np.eye(5, dtype=bool)[:, None], (5, 2, 5))
    found = rates(compute_bounds(factorial(success)))
    assert found["oracle", 1] == 1.0
    assert found["RND", 1] == pytest.approx(0.2)
    assert found["best start for each goal, held out", 1] == 0.0
    assert found["best start for each goal, in sample", 1] == pytest.approx(0.2)
    assert found["best pair for each goal, in sample", 2] == pytest.approx(0.4)


def test_goals_of_their_own_are_chosen_for_by_the_environments_near_them() -> None:
    # Left goals need the first start, right ones the second.
    y = np.linspace(-0.2, 0.2, 20)
    success = np.stack([y < 0.0, y > 0.0, y > 1.0], axis=1)[:, None]
    goals = np.column_stack([np.full(20, 0.7), y])[:, None]
    found = rates(compute_bounds(factorial(success, goals)))
    assert found["best start for each goal, held out", 1] >= 0.9
    assert found["one start for all goals, held out", 1] <= 0.5
    assert found["best pair for each goal, held out", 2] == 1.0
    assert not any("in sample" in name for name, _ in found)


@pytest.mark.parametrize("shape", [(1, 3, 4), (3, 2, 1)])
def test_bounds_need_environments_and_starts_to_choose_from(shape: tuple[int, ...]) -> None:
    with pytest.raises(LibraryError, match="bounds need 2 environments and 2 starts, got"):
        compute_bounds(factorial(np.ones(shape, dtype=bool)))


def test_intervals_are_reproducible_and_cover_the_rate_of_all_environments() -> None:
    rng = np.random.default_rng(6)
    covered = []
    for _ in range(300):
        # Environments differ in their luck, which all their reaches share.
        luck = rng.beta(2.0, 2.0, size=(40, 1, 1))
        success = rng.random((40, 5, 6)) < luck
        bound = Bound(name="RND", attempts=1, by_environment=random_rate(success))
        low, high = bound.interval()
        covered.append(low <= 0.5 <= high)
    assert np.mean(covered) == pytest.approx(0.9, abs=0.06)
    assert bound.interval() == bound.interval()
    wide = bound.interval(0.99)
    assert wide[0] < low < bound.rate < high < wide[1]


def test_share_of_gap() -> None:
    assert share_of_gap(0.5, 0.6, 0.7) == pytest.approx(0.5)
    assert share_of_gap(0.5, 0.4, 0.7) == pytest.approx(-0.5)
    assert share_of_gap(0.5, 0.8, 0.7) == pytest.approx(1.5)
    assert isnan(share_of_gap(0.5, 0.5, 0.5))


def test_the_table_tells_what_share_of_each_gap_is_closed() -> None:
    success = np.broadcast_to(np.eye(4, dtype=bool)[:3], (5, 3, 4))
    bounds = compute_bounds(factorial(success))
    table = bounds_table(bounds, "cylinder-clutter", {"LIC(GP)": {1: 0.7, 2: 0.8}, "K": {1: 0.4}})
    assert table.heading[-2:] == ("gap closed by LIC(GP), %", "gap closed by K, %")
    found = {row[:2]: row[2:] for row in table.rows if row}
    assert found["1", "RND"] == ("25.0", "25.0..25.0", "", "")
    assert found["1", "best start for each goal, held out"] == ("100.0", "100.0..100.0", "60", "20")
    assert found["2", "oracle"] == ("100.0", "100.0..100.0", "60", "")
    assert "in 5 environments" in table.caption
