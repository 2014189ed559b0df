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

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import FeatureMap
from lic_drake.evaluate.bounds import Bound

Vector = NDArray[np.float64]


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


def load_choices(columns: Mapping[str, NDArray[Any]], features: FeatureMap) -> Choices:
    """Returns the choices that a library holds, see `ExperienceLibrary.columns`."""
    rows = features.rows(columns)
    _, environment = np.unique(rows.environment, return_inverse=True)
    return Choices(success=rows.f > 0.5, environment=environment.ravel(), Z=rows.Z)


def choice_bounds(choices: Choices, reference: SuccessEstimator) -> list[Bound]:
    """Returns RND's rate and the bounds above it, for one and for two attempts.

    Two attempts find fresh copies of the environment.

    Args:
        choices: The reaches.
        reference: An estimator that never saw their environments.
    """
    score = reference.values(choices.Z)
    groups = [choices.environment == e for e in range(choices.environment.max() + 1)]
    success = [choices.success[group] for group in groups]
    best = [score[group] == score[group].max() for group in groups]
    return [
        Bound(name="RND", attempts=1, by_environment=_random(success, 1)),
        Bound(
            name="best start by more experience, held out",
            attempts=1,
            by_environment=np.array([s[b].mean() for s, b in zip(success, best, strict=True)]),
        ),
        Bound(
            name="oracle", attempts=1, by_environment=np.array([s.any() for s in success], float)
        ),
        Bound(name="RND", attempts=2, by_environment=_random(success, 2)),
        Bound(
            name="oracle", attempts=2, by_environment=np.array([s.any() for s in success], float)
        ),
    ]


def _random(success: list[NDArray[np.bool_]], attempts: int) -> Vector:
    """Returns RND's expected success in each environment, without trying a start twice."""
    return np.array(
        [1.0 - math.comb(int((~s).sum()), attempts) / math.comb(len(s), attempts) for s in success]
    )
