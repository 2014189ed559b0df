"""From records, goals and starts to feature vectors x, and the features of each category."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lic_drake.clutter.registry import get_category
from lic_drake.errors import EstimateError
from lic_drake.experience.pairs import FIRST_PREFIX, SHOWN
from lic_drake.types import BoolVector, IntVector, Vector

_GOAL = ("goal_x", "goal_y", "goal_z")
_IN_PLANE = ("start_x", "start_y", "start_phi")
_IN_SPACE = ("start_x", "start_y", "start_z", "start_qw", "start_qx", "start_qy", "start_qz")
_START = (*_IN_PLANE, *_IN_SPACE[2:])
_OBSERVED = tuple(FIRST_PREFIX + name for name in SHOWN)

_POSITIONS = tuple((f"{what}_x", f"{what}_y", f"{what}_z") for what in ("goal", "start", "final"))
AXIS_OF_POSITION = {name: axis for names in _POSITIONS for axis, name in enumerate(names)}
"""The position columns and their axes: in R they are smaller by that component of b0. Angles and
velocities are the same in R as in W."""

_DECIMALS = 9  # Differences of the same numbers in another order are the same feature, metres.


@dataclass(frozen=True, kw_only=True)
class ExperienceRows:
    """Past reaches as an estimator takes them.

    Attributes:
        X: Features, shape (n, d).
        y: Successes, shape (n,), each 0 or 1.
        groups: Number of each reach's environment, shape (n,).
        weight: How many simulated reaches each counts as, shape (n,).
        simulated: Whether each comes from simulation, shape (n,).
    """

    X: Vector
    y: Vector
    groups: IntVector
    weight: Vector
    simulated: BoolVector


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """Which columns of the records make up x: first the situation, then the decision.

    Positions are those in the robot's frame R, which has the axes of the world W and its origin
    at b0, the base's place and the torso's height: the translation T_b0 of paper Eq. (3).

    Attributes:
        goal: Columns of the goal p_WG, a part of goal_x, goal_y, goal_z, metres.
        start: Columns of the initial condition x0 that the robot chooses, a part of start_x,
            start_y, start_phi, or in space of start_x, start_y, start_z and the quaternion
            start_qw, start_qx, start_qy, start_qz, metres and radians.
        observed: Columns of what the first reach showed, for LIC-2: "first_" before names of
            `lic_drake.experience.pairs.SHOWN`, metres, radians and m/s.
        relative: Whether each goal column is replaced by its difference from the start: the first
            start column minus the first goal column, and so on. LIC-1 only.
    """

    goal: tuple[str, ...]
    start: tuple[str, ...]
    observed: tuple[str, ...] = ()
    relative: bool = False

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
        if self.relative and (self.observed or len(self.goal) > len(self.start)):
            raise EstimateError(
                "features relative to the goal need a start column for each goal column and no"
                f" observed ones, got {self.columns}"
            )

    @property
    def in_space(self) -> bool:
        """Whether hand poses are positions and quaternions."""
        return not set(self.start) <= set(_IN_PLANE)

    @property
    def columns(self) -> tuple[str, ...]:
        """The d columns that x is made of: goal, observed, start."""
        return self.goal + self.observed + self.start

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the d features, in the order of x."""
        if not self.relative:
            return self.columns
        return tuple(f"{e} - {g}" for e, g in zip(self.start, self.goal, strict=False)) + self.start

    @property
    def situation(self) -> slice:
        """The part of the columns that is given."""
        return slice(0, len(self.goal) + len(self.observed))

    @property
    def decision(self) -> slice:
        """The part of the columns that the robot chooses."""
        return slice(self.situation.stop, len(self.columns))

    @property
    def goal_matrix(self) -> Vector:
        """The matrix, shape (k, d), that takes x to the goal in R."""
        # What replaces the goal by its difference from the start also brings it back.
        return self._matrix[: len(self.goal)]

    def rows(self, columns: Mapping[str, NDArray[Any]]) -> ExperienceRows:
        """Returns the rows of a library.

        Every record counts, whatever its outcome: a reach that diverged or never began is a
        failure, as it is when a selected start is evaluated.

        Args:
            columns: Arrays of equal length named as the fields of `ReachRecord`; with observed
                features those of `lic_drake.experience.pairs.pair_reaches`. Defaults: 0 for
                base_x, base_y and torso, 1 for weight, "simulation" for source.

        Raises:
            EstimateError: A column is missing.
        """
        needed = (*self.columns, "success", "stream", "environment")
        missing = [name for name in needed if name not in columns]
        if missing:
            raise EstimateError(
                f"the library has no column {missing[0]!r}; it needs {', '.join(needed)}"
            )
        # Environments of different streams share indices.
        streams, stream = np.unique(columns["stream"].astype(str), return_inverse=True)
        groups = columns["environment"].astype(np.int64) * len(streams) + stream
        count = len(groups)
        b0 = [columns.get(name, np.zeros(count)) for name in ("base_x", "base_y", "torso")]
        values = np.column_stack([np.asarray(columns[name], dtype=float) for name in self.columns])
        return ExperienceRows(
            X=self._features(values - np.column_stack(b0) @ _base_part(self.columns).T),
            y=np.asarray(columns["success"], dtype=float),
            groups=groups,
            weight=np.asarray(columns.get("weight", np.ones(count)), dtype=float),
            simulated=columns.get("source", np.full(count, "simulation")) == "simulation",
        )

    def join(self, p_RG: ArrayLike, x0: ArrayLike, observed: ArrayLike | None = None) -> Vector:
        """Returns x, shape (..., d).

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
                f"x needs {len(self.observed)} observed features, got shape {seen.shape}"
            )
        goal = p_RG[..., [_GOAL.index(name) for name in self.goal]]
        start = x0[..., self._start_indices()]
        shape = np.broadcast_shapes(goal.shape[:-1], seen.shape[:-1], start.shape[:-1])
        parts = [np.broadcast_to(part, shape + part.shape[-1:]) for part in (goal, seen, start)]
        return self._features(np.concatenate(parts, axis=-1))

    def observation(self, first: Mapping[str, float], b0: ArrayLike = (0.0, 0.0, 0.0)) -> Vector:
        """Returns the observed features in the frame of a robot about to make its second reach.

        Args:
            first: What the first reach showed, in W, by the names of
                `lic_drake.experience.pairs.SHOWN`, metres, radians and m/s.
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
        return np.array(seen) - np.asarray(b0, dtype=float) @ _base_part(self.observed).T

    def gradient_by_x0(self, gradient: Vector) -> Vector:
        """Returns a gradient by x0, shape (3,) or in space (7,), from one by x, shape (d,).

        Components of x0 that are no feature get zero.
        """
        by_x0 = np.zeros(len(self._pose_names))
        by_x0[self._start_indices()] = self._by_columns(gradient)[self.decision]
        return by_x0

    def gradient_by_base(self, gradient: Vector) -> Vector:
        """Returns a gradient by b0 = (x, y, torso), shape (3,), from one by x, shape (d,).

        Goal, first reach and start are fixed in W, so that positions in R change by minus the
        displacement of the base.
        """
        return -(_base_part(self.columns).T @ self._by_columns(gradient))

    def _features(self, values: Vector) -> Vector:
        """Returns x from the columns' values in R, both of shape (..., d)."""
        if not self.relative:
            return values
        return np.round(values @ self._matrix.T, _DECIMALS)

    def _by_columns(self, gradient: Vector) -> Vector:
        """Returns the gradient by the columns from one by x, both of shape (d,)."""
        return self._matrix.T @ gradient if self.relative else gradient

    @cached_property
    def _matrix(self) -> Vector:
        """The matrix, shape (d, d), that takes the columns to x."""
        matrix = np.eye(len(self.columns))
        if self.relative:
            for k in range(len(self.goal)):
                matrix[k, k], matrix[k, self.decision.start + k] = -1.0, 1.0
        return matrix

    def _start_indices(self) -> list[int]:
        return [self._pose_names.index(name) for name in self.start]

    @property
    def _pose_names(self) -> tuple[str, ...]:
        return _IN_SPACE if self.in_space else _IN_PLANE


def _base_part(columns: tuple[str, ...]) -> Vector:
    """Returns the matrix, shape (d, 3), that takes b0 to what it adds to positions in W."""
    part = np.zeros((len(columns), 3))
    for row, name in enumerate(columns):
        axis = AXIS_OF_POSITION.get(name.removeprefix(FIRST_PREFIX))
        if axis is not None:
            part[row, axis] = 1.0
    return part


PLANAR_LIC1 = FeatureMap(goal=("goal_x", "goal_y"), start=("start_y", "start_phi"))
"""LIC-1 in the plane; x is constant along the start line and therefore not a feature."""

SPACE_LIC1 = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z"), relative=True)
"""LIC-1 in space, where tools start in one plane across x, point along x, and goals lie in another.

The PR2's success depends mainly on the offset between goal and aperture across x. A kernel with one
scale per feature captures it only if the offset itself is a feature: the start that the process
chooses succeeds for 183 of 480 held-out goals instead of 163
(notebooks/results/ablation/space_features.md). The roll is not a feature, as the aperture's place
determines it.
"""


@dataclass(frozen=True, kw_only=True)
class CategoryFeatures:
    """What the robot knows before its first and second reach in a category (paper IV-A).

    Attributes:
        first: Features of LIC-1: goal and start.
        second: Features of LIC-2: also what the first reach showed, the paper's o. None: the
            category has no LIC-2, and further starts are LIC-1's best away from the failed ones.
    """

    first: FeatureMap
    second: FeatureMap | None


def features_of(category: str) -> CategoryFeatures:
    """Returns the features of a category, as it was registered.

    Raises:
        ScenarioError: The category is unknown.
        EstimateError: One of its features is unknown.
    """
    known = get_category(category)
    first = SPACE_LIC1 if known.in_space else PLANAR_LIC1
    if known.observed is None:
        return CategoryFeatures(first=first, second=None)
    second = replace(first, observed=known.observed, relative=False)
    return CategoryFeatures(first=first, second=second)
