"""What is known before a reach, and what was chosen."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.experience.pairs import SHOWN
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.start import IN_PLANE, POSE_AXES, Start, Starts
from lic_drake.starts import FeasibleStarts, Region
from lic_drake.types import BoolVector, Vector

RETRY_DISTANCES_M = (0.1, 0.05, 0.025, 0.0, -1.0)
"""A further attempt starts more than the first of these from all failed ones, with the hand across
x or, in space, with base and torso: the "local neighborhood" of paper VI-A, whose size it does not
state; one grid step. Where that leaves no start, the next of them counts; -1 excludes only
the failed starts themselves."""


@dataclass(frozen=True, kw_only=True)
class FailedReach:
    """What a reach that failed showed (paper III-C), all in W.

    `shown` has what an observation o may be made of, by the names of the records' columns, see
    `lic_drake.experience.pairs.SHOWN`; the final values are only there if it began at all. The
    `request` of a simulated reach leads to all that the skin felt.
    """

    start: Start
    shown: Mapping[str, float]
    request: ReachRequest | None = None

    @classmethod
    def from_start(cls, start: Start) -> Self:
        """Returns a failure of which nothing but its start is known."""
        axes = POSE_AXES[len(start.x0)]
        shown = {f"start_{axis}": float(x) for axis, x in zip(axes, start.x0, strict=True)}
        return cls(start=start, shown=shown)

    @classmethod
    def from_record(cls, record: ReachRecord, request: ReachRequest | None = None) -> Self:
        """Returns what a record says of a failed reach, and its request if that is known."""
        shown = {name: getattr(record, name) for name in SHOWN}
        return cls(start=record.start, shown=shown, request=request)


@dataclass(frozen=True, kw_only=True)
class Situation:
    """The goal, the feasible starts, and the attempts at the goal that failed, in their order."""

    p_WG: Vector
    starts: FeasibleStarts
    failed: tuple[FailedReach, ...] = ()

    def __post_init__(self) -> None:
        if self.p_WG.shape != (3,) or not np.all(np.isfinite(self.p_WG)):
            raise RequestError(f"a goal is three finite numbers in metres, got {self.p_WG}")

    @cached_property
    def retry_distance_m(self) -> float:
        """How far from failed attempts a further one starts, metres."""
        leaves_some = (d for d in RETRY_DISTANCES_M if np.any(self._away(self.starts.grid, d)))
        return next(leaves_some, RETRY_DISTANCES_M[-1])

    def allowed(self, some: Starts) -> BoolVector:
        """Returns which of n starts are far enough from all failed ones, shape (n,)."""
        return self._away(some, self.retry_distance_m)

    def free_regions(self) -> tuple[Region, ...]:
        """Returns the parts of the regions that are away from all failed attempts.

        In space these are all of them: a failed aperture may be tried from another base.
        """
        regions, margin = self.starts.regions, self.retry_distance_m + 1e-6
        if margin < 0.0 or not self.failed or not self.starts.arm.is_planar:
            return regions
        failed = [reach.start for reach in self.failed]
        return tuple(part for region in regions for part in region.away_from(failed, margin))

    def _away(self, some: Starts, distance_m: float) -> BoolVector:
        away = np.ones(len(some), dtype=bool)
        for failed in (reach.start for reach in self.failed):
            same_pose = np.all(np.isclose(some.x0, failed.x0), axis=1)
            away &= ~(same_pose & np.all(np.isclose(some.b0, failed.b0), axis=1))
            across = slice(1, 2 if len(failed.x0) == IN_PLANE else 3)
            apart = np.linalg.norm(some.x0[:, across] - failed.x0[across], axis=1)
            if len(failed.x0) != IN_PLANE:
                apart = np.maximum(apart, np.linalg.norm(some.b0 - failed.b0, axis=1))
            away &= apart > distance_m + 1e-9
        return away


@dataclass(frozen=True)
class Selection:
    """A chosen start with joint angles, by which strategy, and how long that took.

    `probability` is the estimated one of success; None for strategies without an estimate.
    """

    start: Start
    probability: float | None
    method: str
    seconds: float
