"""Feature vectors x of records, goals and starts, and the features of each category."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

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

_DECIMALS = 9  # Equal offsets computed from different numbers must be one feature value.


@dataclass(frozen=True, kw_only=True)
class ExperienceRows:
    """Past reaches as arguments of `SuccessEstimator.fit`, and whether each was simulated."""

    X: Vector
    y: Vector
    groups: IntVector
    weight: Vector
    simulated: BoolVector


@dataclass(frozen=True, kw_only=True)
class FeatureMap:
    """The record columns that make up x: first the situation, then the decision.

    Positions are expressed in the robot's frame R, which has the axes of the world W and its origin
    at b0 (base position and torso height): the translation T_b0 of paper Eq. (3).

    Attributes:
        goal: Some of goal_x, goal_y, goal_z, metres.
        start: Of the initial condition x0: some of start_x, start_y, start_phi, or in space of
            start_x, start_y, start_z and start_qw .. start_qz.
        observed: For LIC-2, what the first reach observed: "first_" followed by a name in
            `lic_drake.experience.pairs.SHOWN`, metres, radians and m/s.
        relative: For LIC-1, whether the k-th start column minus the k-th goal replaces the latter.
    """

    goal: tuple[str, ...]
    start: tuple[str, ...]
    observed: tuple[str, ...] = ()
    relative: bool = False

    def __post_init__(self) -> None:
        parts = {"goal": _GOAL, "start": _START, "observed": _OBSERVED}
        for kind, known in parts.items():
            names = getattr(self, kind)
            if not set(names) <= set(known) or len(set(names)) < len(names):
                raise EstimateError(
                    f"{kind} features must be some of {', '.join(known)}, each once, got {names}"
                )
        if self.relative and (self.observed or len(self.goal) > len(self.start)):
            raise EstimateError(
                "relative features need a start column for each goal column and no observed"
                f" ones, got {self.columns}"
            )

    @property
    def in_space(self) -> bool:
        """Whether hand poses are positions and quaternions."""
        return not set(self.start) <= set(_IN_PLANE)

    @property
    def columns(self) -> tuple[str, ...]:
        """The d columns of x: goal, observed, start."""
        return self.goal + self.observed + self.start

    @property
    def situation(self) -> slice:
        """The given part of x."""
        return slice(0, len(self.goal) + len(self.observed))

    @property
    def decision(self) -> slice:
        """The part of x that the robot chooses."""
        return slice(self.situation.stop, len(self.columns))

    @property
    def goal_matrix(self) -> Vector:
        """The matrix, shape (k, d), that maps x to the goal in R."""
        return self._matrix[: len(self.goal)]  # The map to relative features is its own inverse.

    def rows(self, columns: Mapping[str, NDArray[Any]]) -> ExperienceRows:
        """Returns the training rows of a library, in which a reach that never began is a failure.

        Args:
            columns: Arrays of equal length, named as the fields of `ReachRecord`; with observed
                features those of `lic_drake.experience.pairs.pair_reaches`. Base, torso, weight
                and source may be missing: 0, 1 and "simulation".
        """
        needed = (*self.columns, "success", "stream", "environment")
        for name in needed:
            if name not in columns:
                raise EstimateError(
                    f"the library has no column {name!r}; it needs {', '.join(needed)}"
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
            p_RG: Goal in R, shape (..., 3), metres.
            x0: Initial condition in R, shape (..., 3) or (..., 7), see `Start.x0`.
            observed: Observed features, shape (..., k), see `observation`; none by default.
        """
        p_RG, x0 = np.asarray(p_RG, dtype=float), np.asarray(x0, dtype=float)
        seen = np.zeros(0) if observed is None else np.asarray(observed, dtype=float)
        if seen.shape[-1:] != (len(self.observed),):
            raise EstimateError(
                f"x needs {len(self.observed)} observed features, got shape {seen.shape}"
            )
        goal = p_RG[..., [_GOAL.index(name) for name in self.goal]]
        start = x0[..., self._start_indices]
        shape = np.broadcast_shapes(goal.shape[:-1], seen.shape[:-1], start.shape[:-1])
        parts = [np.broadcast_to(part, shape + part.shape[-1:]) for part in (goal, seen, start)]
        return self._features(np.concatenate(parts, axis=-1))

    def observation(self, first: Mapping[str, float], b0: ArrayLike = (0.0, 0.0, 0.0)) -> Vector:
        """Returns the observed features, shape (..., k), in the frame R of the second reach.

        Args:
            first: What the first reach observed, in W, by the names in
                `lic_drake.experience.pairs.SHOWN`.
            b0: Origin of R in the second reach, shape (..., 3), metres.
        """
        seen = [first.get(name.removeprefix(FIRST_PREFIX), np.nan) for name in self.observed]
        if not np.all(np.isfinite(seen)):
            missing = self.observed[np.argmin(np.isfinite(seen))]
            raise EstimateError(
                f"the first reach has no {missing}: it never began; use LIC-1 for the second start"
            )
        return np.array(seen) - np.asarray(b0, dtype=float) @ _base_part(self.observed).T

    def gradient_by_x0(self, gradient: Vector) -> Vector:
        """Returns the gradient by x0, shape (3,) or (7,), from that by x, shape (d,)."""
        by_x0 = np.zeros(len(_IN_SPACE if self.in_space else _IN_PLANE))
        by_x0[self._start_indices] = (self._matrix.T @ gradient)[self.decision]
        return by_x0

    def gradient_by_base(self, gradient: Vector) -> Vector:
        """Returns the gradient by b0, shape (3,), with goal, first reach and start fixed in W."""
        return -(_base_part(self.columns).T @ (self._matrix.T @ gradient))

    def _features(self, values: Vector) -> Vector:
        """Returns x from the columns' values in R, both of shape (..., d)."""
        return np.round(values @ self._matrix.T, _DECIMALS) if self.relative else values

    @cached_property
    def _matrix(self) -> Vector:
        """The matrix, shape (d, d), that maps the columns to x."""
        matrix = np.eye(len(self.columns))
        if self.relative:
            for k in range(len(self.goal)):
                matrix[k, k], matrix[k, self.decision.start + k] = -1.0, 1.0
        return matrix

    @property
    def _start_indices(self) -> list[int]:
        pose = _IN_SPACE if self.in_space else _IN_PLANE
        return [pose.index(name) for name in self.start]


def _base_part(columns: tuple[str, ...]) -> Vector:
    """Returns the derivative of columns in W by b0, shape (d, 3): 1 for positions, else 0."""
    positions = [(f"goal_{axis}", f"start_{axis}", f"final_{axis}") for axis in "xyz"]
    names = [name.removeprefix(FIRST_PREFIX) for name in columns]
    return np.array([[float(name in axis) for axis in positions] for name in names]).reshape(-1, 3)


PLANAR_LIC1 = FeatureMap(goal=("goal_x", "goal_y"), start=("start_y", "start_phi"))
"""LIC-1 in the plane; start_x is constant along the start line and therefore not a feature."""

SPACE_LIC1 = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z"), relative=True)
"""LIC-1 in space, where tools point along x.

The offset between goal and aperture across x is a feature since success depends mainly on it: see
notebooks/results/ablation/space_features.md. The aperture determines the roll.
"""


class CategoryFeatures(NamedTuple):
    """Features of LIC-1 and LIC-2 (paper IV-A); `second` is None where there is no LIC-2."""

    first: FeatureMap
    second: FeatureMap | None


def features_of(category: str) -> CategoryFeatures:
    """Returns the features of a registered category."""
    known = get_category(category)
    first = SPACE_LIC1 if known.in_space else PLANAR_LIC1
    if known.observed is None:
        return CategoryFeatures(first, None)
    return CategoryFeatures(first, replace(first, observed=known.observed, relative=False))
