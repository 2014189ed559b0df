"""From records, goals and starts to feature vectors z = (situation s, initial condition x0)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.checks import EstimateError, Vector

_GOAL = ("goal_x", "goal_y", "goal_z")
_START = ("start_x", "start_y", "start_phi")


@dataclass(frozen=True, kw_only=True)
class ExperienceRows:
    """Past reaches as an estimator takes them.

    Attributes:
        Z: Features, shape (n, d).
        f: Successes, shape (n,), each 0 or 1.
        environment: Number that stands for each reach's environment, shape (n,).
    """

    Z: Vector
    f: Vector
    environment: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """Which columns of the records make up z: first the situation, then the decision.

    Attributes:
        goal: Columns of the goal p_WG, a part of goal_x, goal_y, goal_z, metres.
        start: Columns of the initial condition x0 that the robot chooses, a part of start_x,
            start_y, start_phi, metres and radians.
    """

    goal: tuple[str, ...]
    start: tuple[str, ...]

    def __post_init__(self) -> None:
        for kind, names, known in (("goal", self.goal, _GOAL), ("start", self.start, _START)):
            if not names or not set(names) <= set(known) or len(set(names)) < len(names):
                raise EstimateError(
                    f"{kind} features must be some of {', '.join(known)}, each once, got {names}"
                )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the d features, in the order of z."""
        return self.goal + self.start

    @property
    def situation(self) -> slice:
        """The part of z that is given."""
        return slice(0, len(self.goal))

    @property
    def decision(self) -> slice:
        """The part of z that the robot chooses."""
        return slice(len(self.goal), len(self.names))

    def rows(self, columns: Mapping[str, NDArray[Any]]) -> ExperienceRows:
        """Returns the rows of a library.

        Every record counts, whatever its outcome: a reach that diverged or never began is a
        failure, as it is when a selected start is evaluated.

        Args:
            columns: Arrays of equal length named as the fields of `ReachRecord`.

        Raises:
            EstimateError: A column is missing.
        """
        needed = (*self.names, "success", "stream", "environment")
        missing = [name for name in needed if name not in columns]
        if missing:
            raise EstimateError(
                f"the library has no column {missing[0]!r}; it needs {', '.join(needed)}"
            )
        # Environments of different streams share indices.
        streams, stream = np.unique(columns["stream"].astype(str), return_inverse=True)
        environment = columns["environment"].astype(np.int64) * len(streams) + stream
        return ExperienceRows(
            Z=np.column_stack([np.asarray(columns[name], dtype=float) for name in self.names]),
            f=np.asarray(columns["success"], dtype=float),
            environment=environment,
        )

    def join(self, p_WG: ArrayLike, x0: ArrayLike) -> Vector:
        """Returns z, shape (..., d).

        Args:
            p_WG: Goal, shape (..., 3), metres.
            x0: Initial condition (x, y, phi), shape (..., 3), metres and radians.
        """
        p_WG, x0 = np.broadcast_arrays(np.asarray(p_WG, dtype=float), np.asarray(x0, dtype=float))
        goal = p_WG[..., [_GOAL.index(name) for name in self.goal]]
        return np.concatenate([goal, x0[..., self._start_indices()]], axis=-1)

    def gradient_by_x0(self, gradient: Vector) -> Vector:
        """Returns a gradient by x0 = (x, y, phi), shape (3,), from one by z, shape (d,).

        Components of x0 that are no feature get zero.
        """
        by_x0 = np.zeros(len(_START))
        by_x0[self._start_indices()] = gradient[self.decision]
        return by_x0

    def _start_indices(self) -> list[int]:
        return [_START.index(name) for name in self.start]


PLANAR_LIC1 = FeatureMap(goal=("goal_x", "goal_y"), start=("start_y", "start_phi"))
"""LIC-1 in the plane; x is the same all along the start line, so it is no feature."""
