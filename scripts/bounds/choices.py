"""Bounds where every environment has its own starts, as behind apertures.

A choice is between the discrete starts of one environment at one goal. There is no table of starts
by environments here, so the population optimum needs an estimator: one with more experience than
LIC's stands in for it.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.estimate.features import FeatureMap
from lic_drake.types import Vector
from scripts.bounds.bounds import Bound


@dataclass(frozen=True, kw_only=True)
class Choices:
    """Reaches from all discrete starts of some environments, one goal in each.

    Attributes:
        success: Whether each reach came to its goal, shape (n,).
        environment: Number of each reach's environment, from 0, shape (n,).
        Z: Features of each, shape (n, d), in the robot's frame.
    """

    success: NDArray[np.bool_]
    environment: NDArray[np.intp]
    Z: Vector

    def chosen_rate(self, score: Vector) -> Vector:
        """Returns the success of the starts with the best score in each environment, shape (E,).

        Starts of equal score share the choice.

        Args:
            score: Score of each reach's start, shape (n,), for instance an estimate.
        """
        best = np.full(self.environment.max() + 1, -np.inf)
        np.maximum.at(best, self.environment, score)
        chosen = score == best[self.environment]
        rate: Vector = np.bincount(self.environment[chosen], self.success[chosen]) / np.bincount(
            self.environment[chosen]
        )
        return rate


def load_choices(columns: Mapping[str, NDArray[Any]], features: FeatureMap) -> Choices:
    """Returns the choices that a library holds, see `ExperienceLibrary.columns`."""
    rows = features.rows(columns)
    _, environment = np.unique(rows.environment, return_inverse=True)
    return Choices(success=rows.f > 0.5, environment=environment.ravel(), Z=rows.Z)


def choice_bounds(choices: Choices, reference: Vector) -> list[Bound]:
    """Returns RND's rate and the bounds above it, for one and for two attempts.

    Two attempts find fresh copies of the environment.

    Args:
        choices: The reaches.
        reference: Estimates for them, shape (n,), by an estimator that never saw their
            environments.
    """
    tries = np.bincount(choices.environment)
    wins = np.bincount(choices.environment, choices.success).astype(int)
    oracle = (wins > 0).astype(float)
    return [
        Bound(name="RND", attempts=1, by_environment=wins / tries),
        Bound(
            name="best start by more experience, held out",
            attempts=1,
            by_environment=choices.chosen_rate(reference),
        ),
        Bound(name="oracle", attempts=1, by_environment=oracle),
        Bound(name="RND", attempts=2, by_environment=_two_random(tries, wins)),
        Bound(name="oracle", attempts=2, by_environment=oracle),
    ]


def _two_random(tries: NDArray[np.intp], wins: NDArray[np.intp]) -> Vector:
    """Returns RND's expected success in two attempts from different starts, shape (E,)."""
    return np.array(
        [1.0 - math.comb(n - k, 2) / math.comb(n, 2) for n, k in zip(tries, wins, strict=True)]
    )
