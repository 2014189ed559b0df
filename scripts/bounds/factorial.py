"""Reaches of a full factorial: every start, at every goal, in every environment."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Factorial:
    """Outcomes of E environments x G goals x S starts.

    Attributes:
        success: Whether each reach came to its goal, shape (E, G, S).
        goals: Goals (x, y), shape (E, G, 2), metres; each environment's in rising order.
        starts: Starts (x, y, phi), shape (S, 3), metres and radians, in rising order.
    """

    success: NDArray[np.bool_]
    goals: Vector
    starts: Vector

    @property
    def has_common_goals(self) -> bool:
        """Whether all environments share their goals."""
        return bool(np.all(self.goals == self.goals[0]))


def load_factorial(columns: Mapping[str, NDArray[Any]]) -> Factorial:
    """Returns the factorial that a library holds.

    Args:
        columns: Columns of the library, see `ExperienceLibrary.columns`.

    Raises:
        LibraryError: Reaches are missing or there twice, environments differ in their number of
            goals, or the library mixes seed streams.
    """
    streams = sorted(set(columns["stream"]))
    if len(streams) != 1:
        raise LibraryError(
            f"bounds need environments of one seed stream, got {', '.join(streams) or 'none'}"
        )
    starts, s = _distinct(columns, "start_x", "start_y", "start_phi")
    environments, e = np.unique(columns["environment"], return_inverse=True)
    # A goal of one environment, in rising order of environments.
    goals, goal = _distinct(columns, "environment", "goal_x", "goal_y")
    num_goals = np.bincount(np.searchsorted(environments, goals[:, 0]))
    if np.any(num_goals != num_goals[0]):
        odd = int(np.flatnonzero(num_goals != num_goals[0])[0])
        raise LibraryError(
            f"environment {environments[odd]} has {num_goals[odd]} goals and environment"
            f" {environments[0]} has {num_goals[0]}; bounds need the same number in all"
        )
    shape = (len(environments), int(num_goals[0]), len(starts))
    g = goal % shape[1]
    tried = np.zeros(shape, dtype=np.int64)
    np.add.at(tried, (e, g, s), 1)
    if np.any(tried != 1):
        odd_e, odd_g, odd_s = (int(index[0]) for index in np.nonzero(tried != 1))
        raise LibraryError(
            f"environment {environments[odd_e]}, goal {odd_g}, start {odd_s} was reached"
            f" {tried[odd_e, odd_g, odd_s]} times; bounds need every start at every goal once"
        )
    success = np.zeros(shape, dtype=bool)
    success[e, g, s] = columns["success"]
    return Factorial(success=success, goals=goals[:, 1:].reshape(*shape[:2], 2), starts=starts)


def _distinct(columns: Mapping[str, NDArray[Any]], *names: str) -> tuple[Vector, NDArray[np.intp]]:
    """Returns the distinct values of some columns, sorted, and which of them each row has."""
    values = np.column_stack([np.asarray(columns[name], dtype=float) for name in names])
    distinct, index = np.unique(values, axis=0, return_inverse=True)
    return distinct, index
