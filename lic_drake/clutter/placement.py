"""Rejection sampling of non-overlapping discs in a rectangle, or balls in a box."""

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

MAX_TRIES = 10_000
"""Attempts per disc before the rectangle counts as full."""


def place_discs(
    rng: np.random.Generator,
    count: int,
    lower: ArrayLike,
    upper: ArrayLike,
    min_distance: float,
) -> Vector:
    """Samples uniform centres, shape (count, d), metres, rejecting those too close to earlier ones.

    The rule of the authors' generator (gt-ros-pkg/hrl-haptic-manip, obstacles.py), which ignores
    goals.

    Args:
        rng: Random generator.
        count: Number of centres.
        lower: Lower corner of their range, shape (d,), metres.
        upper: Upper corner, shape (d,), metres.
        min_distance: Smallest distance between two centres, metres.

    Raises:
        ScenarioError: The discs do not fit.
    """
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    centres = np.empty((count, len(lower)))
    for i in range(count):
        for _ in range(MAX_TRIES):
            candidate = rng.uniform(lower, upper)
            if np.all(np.sum((centres[:i] - candidate) ** 2, axis=1) >= min_distance**2):
                centres[i] = candidate
                break
        else:
            size = np.prod(upper - lower)
            raise ScenarioError(
                f"only {i} of {count} objects fit into {size:.3g} m^{len(lower)} at a distance of"
                f" {min_distance:.3g} m; use fewer or smaller objects or a larger region"
            )
    return centres
