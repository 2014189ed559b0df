"""Success rates that choices of starts attain in reaches of a full factorial.

All rates are given by environment, because reaches in one environment share its luck.
"""

import math
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector

Successes = NDArray[np.bool_]
"""Array that tells which reaches arrived at their goal."""

BANDWIDTHS_M = tuple(float(h) for h in np.geomspace(0.002, 0.4, 24))
"""Widths of the kernel over goals to choose from, metres."""


def random_rate(success: Successes, attempts: int = 1) -> Vector:
    """Returns RND's expected success rate in each environment, shape (E,).

    Every attempt takes one of the starts that were not yet tried, in a fresh copy of the
    environment: all fail with probability C(f, k) / C(S, k), f being the starts that fail.

    Args:
        success: Outcomes, shape (E, G, S).
        attempts: Number of attempts k, at most S.
    """
    S = success.shape[2]
    all_fail = np.array([math.comb(f, attempts) for f in range(S + 1)]) / math.comb(S, attempts)
    rate: Vector = 1.0 - all_fail[S - success.sum(axis=2)].mean(axis=1)
    return rate


def oracle_rate(success: Successes) -> Vector:
    """Returns the share of goals that some start reaches, by environment, shape (E,)."""
    rate: Vector = success.any(axis=2).mean(axis=1)
    return rate


def chosen_rate(success: Successes, score: Vector) -> Vector:
    """Returns the success rate of the starts with the best score, by environment, shape (E,).

    Starts of equal score share the choice.

    Args:
        success: Outcomes, shape (E, G, S).
        score: Score of each start, shape (E, G, S), for instance an estimate of its success.
    """
    best = score == score.max(axis=2, keepdims=True)
    rate: Vector = ((success & best).sum(axis=2) / best.sum(axis=2)).mean(axis=1)
    return rate


def pairs_of_starts(success: Successes) -> Successes:
    """Returns the outcomes of two attempts from each pair of starts, shape (E, G, S (S - 1) / 2).

    Both attempts find a fresh copy of the environment.
    """
    first, second = np.array(list(combinations(range(success.shape[2]), 2))).T
    either: Successes = success[:, :, first] | success[:, :, second]
    return either


def in_sample_score(success: Successes) -> Vector:
    """Returns each start's success rate at each goal in all environments, shape (E, G, S).

    For goals that all environments share.
    """
    score: Vector = np.broadcast_to(success.mean(axis=0), success.shape)
    return score


def one_start_score(success: Successes) -> Vector:
    """Returns each start's success rate in the other environments, whatever the goal, (E, G, S)."""
    elsewhere = (success.sum(axis=0) - success).mean(axis=1, keepdims=True)
    score: Vector = np.broadcast_to(elsewhere / (len(success) - 1), success.shape)
    return score


def held_out_score(success: Successes, goals: Vector, bandwidth: float) -> Vector:
    """Returns each start's success rate in the other environments, near goals counting most.

    With a small bandwidth only the nearest goals count: where environments share their goals,
    the goal itself.

    Args:
        success: Outcomes, shape (E, G, S), E > 1.
        goals: Goals, shape (E, G, 2), metres.
        bandwidth: Standard deviation of the Gaussian weights, metres.

    Returns:
        Rates, shape (E, G, S).
    """
    E, G, S = success.shape
    p = goals.reshape(E * G, 2)
    exponent = -0.5 * ((p[:, None] - p) ** 2).sum(axis=2) / bandwidth**2
    environment = np.repeat(np.arange(E), G)
    exponent[environment[:, None] == environment] = -np.inf
    # Relative to the nearest goal, lest all weights vanish.
    weight = np.exp(exponent - exponent.max(axis=1, keepdims=True))
    score = weight @ success.reshape(E * G, S) / weight.sum(axis=1, keepdims=True)
    # Rounded, so that starts with the same outcomes have equal scores.
    rounded: Vector = np.round(score, 9).reshape(E, G, S)
    return rounded


def choose_bandwidth(success: Successes, goals: Vector) -> float:
    """Returns the bandwidth whose held-out rates have the least squared error.

    Judged by the outcomes of all starts, not by the chosen ones' success, which the bound reports.

    Args:
        success: Outcomes, shape (E, G, S), E > 1.
        goals: Goals, shape (E, G, 2), metres.
    """
    return min(
        BANDWIDTHS_M,
        key=lambda h: float(np.mean((held_out_score(success, goals, h) - success) ** 2)),
    )
