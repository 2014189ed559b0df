from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scripts.bounds.optima import (
    BANDWIDTHS_M,
    choose_bandwidth,
    chosen_rate,
    held_out_score,
    in_sample_score,
    one_start_score,
    oracle_rate,
    pairs_of_starts,
    random_rate,
)

small = arrays(bool, st.tuples(st.integers(2, 4), st.integers(1, 3), st.integers(2, 5)))


def common_goals(success: np.ndarray, step: float = 0.1) -> np.ndarray:
    E, G, _ = success.shape
    return np.broadcast_to(np.column_stack([np.full(G, 0.5), step * np.arange(G)]), (E, G, 2))


@given(small, st.integers(1, 2))
def test_rnd_is_the_mean_over_all_sets_of_starts(success: np.ndarray, attempts: int) -> None:
    sets = list(combinations(range(success.shape[2]), attempts))
    expected = np.mean([success[:, :, list(s)].any(axis=2) for s in sets], axis=0).mean(axis=1)
    np.testing.assert_allclose(random_rate(success, attempts), expected, atol=1e-12)


@given(small)
def test_pairs_are_either_of_two_starts(success: np.ndarray) -> None:
    pairs = pairs_of_starts(success)
    for p, (i, j) in enumerate(combinations(range(success.shape[2]), 2)):
        np.testing.assert_array_equal(pairs[:, :, p], success[:, :, i] | success[:, :, j])
    assert pairs.shape[2] == p + 1
    np.testing.assert_allclose(random_rate(pairs), random_rate(success, 2))


@given(small)
def test_rates_are_ordered(success: np.ndarray) -> None:
    oracle = oracle_rate(success)
    for attempts in (1, 2):
        assert np.all(random_rate(success, attempts) <= oracle + 1e-12)
    in_sample = chosen_rate(success, in_sample_score(success)).mean()
    assert random_rate(success).mean() <= in_sample + 1e-12
    assert in_sample <= oracle.mean() + 1e-12
    # In sample, nothing that knows the goal only is better.
    held_out = held_out_score(success, common_goals(success), 0.002)
    assert chosen_rate(success, held_out).mean() <= in_sample + 1e-12


@given(small)
def test_in_sample_is_the_best_column_of_each_goal(success: np.ndarray) -> None:
    expected = success.mean(axis=0).max(axis=1).mean()
    rate = chosen_rate(success, in_sample_score(success)).mean()
    assert rate == pytest.approx(expected)


def test_the_oracle_counts_goals_that_any_start_reaches() -> None:
    success = np.zeros((2, 2, 3), dtype=bool)
    success[0, 0, 2] = success[1, 0, :2] = success[1, 1, 0] = True
    assert oracle_rate(success).tolist() == [0.5, 1.0]


def test_equal_scores_share_the_choice() -> None:
    success = np.array([[[True, False, False]]])
    assert chosen_rate(success, np.array([[[0.5, 0.5, 0.2]]])).tolist() == [0.5]
    assert chosen_rate(success, np.array([[[0.5, 0.4, 0.2]]])).tolist() == [1.0]


@given(small)
def test_one_start_is_scored_in_the_other_environments_at_all_goals(success: np.ndarray) -> None:
    score = one_start_score(success)
    for e in range(len(success)):
        others = np.delete(success, e, axis=0).mean(axis=(0, 1))
        np.testing.assert_allclose(score[e], np.tile(others, (success.shape[1], 1)))


@given(small)
def test_with_a_small_bandwidth_the_goal_itself_is_judged_elsewhere(success: np.ndarray) -> None:
    score = held_out_score(success, common_goals(success), 0.002)
    for e in range(len(success)):
        others = np.delete(success, e, axis=0).mean(axis=0)
        np.testing.assert_allclose(score[e], others, atol=1e-9)


@given(small)
def test_with_a_large_bandwidth_all_goals_count_alike(success: np.ndarray) -> None:
    score = held_out_score(success, common_goals(success), 1e4)
    np.testing.assert_allclose(score, one_start_score(success), atol=1e-6)


def test_held_out_scores_are_weighted_means_of_the_other_environments() -> None:
    rng = np.random.default_rng(2)
    success, y = rng.random((6, 1, 3)) < 0.5, rng.uniform(-0.2, 0.2, 6)
    goals = np.column_stack([np.full(6, 0.7), y])[:, None]
    score = held_out_score(success, goals, 0.1)
    for e in range(6):
        weights = [np.exp(-0.5 * ((y[e] - y[k]) / 0.1) ** 2) if k != e else 0.0 for k in range(6)]
        expected = np.average(success[:, 0], axis=0, weights=weights)
        np.testing.assert_allclose(score[e, 0], expected, atol=1e-9)


def test_the_environment_itself_never_counts() -> None:
    success = np.zeros((3, 2, 2), dtype=bool)
    success[1] = True
    score = held_out_score(success, common_goals(success), 0.05)
    assert np.all(score[1] == 0.0)
    assert np.all(score[[0, 2]] == 0.5)


def test_goals_far_from_all_others_take_the_nearest() -> None:
    success = np.array([[[True, False]], [[False, True]], [[False, True]]])
    goals = np.array([[[0.5, 0.0]], [[0.5, 100.0]], [[0.5, 101.0]]])
    np.testing.assert_array_equal(held_out_score(success, goals, 0.002)[0, 0], [0.0, 1.0])


@pytest.mark.parametrize(("width", "smallest", "largest"), [(0.02, 0.0, 0.03), (10.0, 0.1, 1.0)])
def test_the_bandwidth_follows_how_fast_success_changes_with_the_goal(
    width: float, smallest: float, largest: float
) -> None:
    rng = np.random.default_rng(4)
    y = rng.uniform(-0.2, 0.2, 400)
    # Each start succeeds with a probability that waves along y.
    phase = np.array([0.0, 2.0, 4.0])
    probability = 0.5 + 0.45 * np.sin(y[:, None] / width + phase)
    success = (rng.random((400, 3)) < probability)[:, None]
    goals = np.column_stack([np.full(400, 0.7), y])[:, None]
    bandwidth = choose_bandwidth(success, goals)
    assert bandwidth in BANDWIDTHS_M
    assert smallest < bandwidth < largest


def test_held_out_choices_approach_the_best_start_and_in_sample_ones_overstate_it() -> None:
    # Start k succeeds with probability p_k in every environment, independently.
    rng = np.random.default_rng(5)
    p = np.array([0.3, 0.45, 0.5, 0.55, 0.6])
    held_out, in_sample = [], []
    for _ in range(200):
        success = rng.random((20, 3, 5)) < p
        score = held_out_score(success, common_goals(success), 0.002)
        held_out.append(chosen_rate(success, score).mean())
        in_sample.append(chosen_rate(success, in_sample_score(success)).mean())
    assert 0.52 < np.mean(held_out) < 0.6
    assert np.mean(in_sample) > 0.61
