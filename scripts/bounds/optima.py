"""Success rates attained by choosing among starts, given reaches from every start to every goal.

Outcomes and scores have the shape (E, G, S): E environments, G goals in each, S starts at each
goal. Rates are given by environment and goal, shape (E, G).
"""

from itertools import combinations

import numpy as np

from lic_drake.types import BoolVector, Vector

BANDWIDTHS_M = tuple(float(h) for h in np.geomspace(0.002, 0.4, 24))
"""Candidate widths of the kernel over goals, metres."""


def random_rate(success: BoolVector, tried: BoolVector, attempts: int = 1) -> Vector:
    """Returns the expected success of RND within some attempts, if each finds a fresh environment.

    All k attempts fail with probability (f / n)^k, where f of the n starts fail.

    Args:
        success: Outcomes, shape (E, G, S).
        tried: Which starts exist, shape (E, G, S).
        attempts: Number of attempts k.
    """
    failing = (tried & ~success).sum(axis=2) / tried.sum(axis=2)
    return np.asarray(1.0 - failing**attempts)


def chosen_rate(success: BoolVector, score: Vector) -> Vector:
    """Returns the success rate of the best-scored starts; those of equal score share it."""
    best = score == score.max(axis=2, keepdims=True)
    return np.asarray((success & best).sum(axis=2) / best.sum(axis=2))


def pairs_of_starts(success: BoolVector) -> BoolVector:
    """Returns the outcomes of an attempt from each of two starts, shape (E, G, S (S - 1) / 2)."""
    first, second = np.array(list(combinations(range(success.shape[2]), 2))).T
    return success[:, :, first] | success[:, :, second]


def in_sample_score(success: BoolVector) -> Vector:
    """Returns each start's success rate at each goal, if all environments share their goals."""
    return np.broadcast_to(success.mean(axis=0), success.shape)


def one_start_score(success: BoolVector) -> Vector:
    """Returns each start's success rate in the other environments, whatever the goal."""
    elsewhere = (success.sum(axis=0) - success).mean(axis=1, keepdims=True)
    return np.broadcast_to(elsewhere / (len(success) - 1), success.shape)


def held_out_score(success: BoolVector, goals: Vector, bandwidth: float) -> Vector:
    """Returns each start's success rate in the other environments, near goals counting most.

    With a small bandwidth only the nearest goals count: where environments share their goals,
    the goal itself.

    Args:
        success: Outcomes, shape (E, G, S), E > 1.
        goals: Goals, shape (E, G, 2), metres.
        bandwidth: Standard deviation of the Gaussian weights, metres.
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
    return np.round(score, 9).reshape(E, G, S)


def choose_bandwidth(success: BoolVector, goals: Vector) -> float:
    """Returns the bandwidth whose held-out rates have the least squared error over all starts."""
    return min(
        BANDWIDTHS_M,
        key=lambda h: float(np.mean((held_out_score(success, goals, h) - success) ** 2)),
    )
