"""From records, goals and starts to feature vectors z = (situation s, initial condition x0)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.estimate.checks import EstimateError
from lic_drake.experience.second_reach import FIRST_PREFIX, SHOWN
from lic_drake.types import Vector

_GOAL = ("goal_x", "goal_y", "goal_z")
_IN_PLANE = ("start_x", "start_y", "start_phi")
_IN_SPACE = ("start_x", "start_y", "start_z", "start_qw", "start_qx", "start_qy", "start_qz")
_START = (*_IN_PLANE, *_IN_SPACE[2:])
_OBSERVED = tuple(FIRST_PREFIX + name for name in SHOWN)


@dataclass(frozen=True, kw_only=True)
class ExperienceRows:
    """Past reaches as an estimator takes them.

    Attributes:
        Z: Features, shape (n, d).
        f: Successes, shape (n,), each 0 or 1.
        environment: Number that stands for each reach's environment, shape (n,).
        weight: How many simulated reaches each counts as, shape (n,), or one number for all.
    """

    Z: Vector
    f: Vector
    environment: NDArray[np.int64]
    weight: Vector | float = 1.0


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """Which columns of the records make up z: first the situation, then the decision.

    Positions are those in the robot's frame R, which has the axes of the world W and its origin
    at b0, the base's place and the torso's height: the translation T_b0 of paper Eq. (3). Angles
    and velocities are the same in both.

    Attributes:
        goal: Columns of the goal p_WG, a part of goal_x, goal_y, goal_z, metres.
        start: Columns of the initial condition x0 that the robot chooses, a part of start_x,
            start_y, start_phi, or in space of start_x, start_y, start_z and the quaternion
            start_qw, start_qx, start_qy, start_qz, metres and radians.
        observed: Columns of what the first reach showed, for LIC-2: "first_" before names of
            `lic_drake.experience.second_reach.SHOWN`, metres, radians and m/s.
    """

    goal: tuple[str, ...]
    start: tuple[str, ...]
    observed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for kind, names, known in (
            ("goal", self.goal, _GOAL),
            ("start", self.start, _START),
            ("observed", self.observed, _OBSERVED),
        ):
            needed = kind != "observed" and not names
            if needed or not set(names) <= set(known) or len(set(names)) < len(names):
                raise EstimateError(
                    f"{kind} features must be some of {', '.join(known)}, each once, got {names}"
                )
        if "start_phi" in self.start and self.in_space:
            raise EstimateError(f"start features are of the plane or of space, got {self.start}")

    @property
    def in_space(self) -> bool:
        """Whether hand poses are positions and quaternions."""
        return not set(self.start) <= set(_IN_PLANE)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the d features, in the order of z."""
        return self.goal + self.observed + self.start

    @property
    def situation(self) -> slice:
        """The part of z that is given."""
        return slice(0, len(self.goal) + len(self.observed))

    @property
    def decision(self) -> slice:
        """The part of z that the robot chooses."""
        return slice(self.situation.stop, len(self.names))

    def rows(self, columns: Mapping[str, NDArray[Any]]) -> ExperienceRows:
        """Returns the rows of a library.

        Every record counts, whatever its outcome: a reach that diverged or never began is a
        failure, as it is when a selected start is evaluated.

        Args:
            columns: Arrays of equal length named as the fields of `ReachRecord`; with observed
                features those of `lic_drake.experience.second_reach.pair_reaches`. Without
                base_x, base_y and torso they are 0, without weight it is 1.

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
        origin = np.zeros(len(environment))
        b0 = np.column_stack([columns.get(name, origin) for name in ("base_x", "base_y", "torso")])
        Z = np.column_stack([np.asarray(columns[name], dtype=float) for name in self.names])
        return ExperienceRows(
            Z=Z - b0 @ self._base_selection(self.names).T,
            f=np.asarray(columns["success"], dtype=float),
            environment=environment,
            weight=np.asarray(columns["weight"], dtype=float) if "weight" in columns else 1.0,
        )

    def join(self, p_RG: ArrayLike, x0: ArrayLike, observed: ArrayLike | None = None) -> Vector:
        """Returns z, shape (..., d).

        Args:
            p_RG: Goal in the robot's frame, shape (..., 3), metres.
            x0: Initial condition in it, (x, y, phi), shape (..., 3), or position and quaternion,
                shape (..., 7), metres and radians.
            observed: The observed features in it, shape (..., k), see `observation`; by default
                there are none.

        Raises:
            EstimateError: Another number of observed features than the map has.
        """
        p_RG, x0 = np.asarray(p_RG, dtype=float), np.asarray(x0, dtype=float)
        seen = np.zeros(0) if observed is None else np.asarray(observed, dtype=float)
        if seen.shape[-1:] != (len(self.observed),):
            raise EstimateError(
                f"z needs {len(self.observed)} observed features, got shape {seen.shape}"
            )
        goal = p_RG[..., [_GOAL.index(name) for name in self.goal]]
        start = x0[..., self._start_indices()]
        shape = np.broadcast_shapes(goal.shape[:-1], seen.shape[:-1], start.shape[:-1])
        parts = [np.broadcast_to(part, shape + part.shape[-1:]) for part in (goal, seen, start)]
        return np.concatenate(parts, axis=-1)

    def observation(self, first: Mapping[str, float], b0: ArrayLike = (0.0, 0.0, 0.0)) -> Vector:
        """Returns the observed features in the frame of a robot about to make its second reach.

        Args:
            first: What the first reach showed, in W, by the names of
                `lic_drake.experience.second_reach.SHOWN`, metres, radians and m/s.
            b0: Place (x, y) of the base and height of the torso in the second reach, shape
                (..., 3), metres.

        Returns:
            Shape (..., k), in the order of `observed`.

        Raises:
            EstimateError: A value is missing or not finite: the first reach never began.
        """
        seen = [first.get(name.removeprefix(FIRST_PREFIX), np.nan) for name in self.observed]
        if not np.all(np.isfinite(seen)):
            raise EstimateError(
                f"the first reach shows no {self.observed[np.argmin(np.isfinite(seen))]}, as if it"
                " never began; choose the second start as a first one"
            )
        moved = np.asarray(b0, dtype=float) @ self._base_selection(self.observed).T
        observed: Vector = np.array(seen) - moved
        return observed

    def gradient_by_x0(self, gradient: Vector) -> Vector:
        """Returns a gradient by x0, shape (3,) or in space (7,), from one by z, shape (d,).

        Components of x0 that are no feature get zero.
        """
        by_x0 = np.zeros(len(self._pose_names))
        by_x0[self._start_indices()] = gradient[self.decision]
        return by_x0

    def gradient_by_base(self, gradient: Vector) -> Vector:
        """Returns a gradient by b0 = (x, y, torso), shape (3,), from one by z, shape (d,).

        Goal, first reach and start stand still in the world, so that every position in z moves
        by minus what the base moves.
        """
        by_base: Vector = -(self._base_selection(self.names).T @ gradient)
        return by_base

    def _start_indices(self) -> list[int]:
        return [self._pose_names.index(name) for name in self.start]

    @property
    def _pose_names(self) -> tuple[str, ...]:
        return _IN_SPACE if self.in_space else _IN_PLANE

    @staticmethod
    def _base_selection(names: tuple[str, ...]) -> Vector:
        """Returns the matrix that takes b0 out of features, shape (d, 3)."""
        moved = [[name.endswith(axis) for axis in ("_x", "_y", "_z")] for name in names]
        return np.array(moved, dtype=float).reshape(-1, 3)


PLANAR_LIC1 = FeatureMap(goal=("goal_x", "goal_y"), start=("start_y", "start_phi"))
"""LIC-1 in the plane; x is the same all along the start line, so it is no feature."""

SPACE_LIC1 = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z", "start_qx"))
"""LIC-1 in space, where tools start in a plane across x, point along it, and goals lie in another.

Of the quaternion only the roll about x is then left, and the sine of half its angle says it all.
"""
