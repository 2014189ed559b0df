"""`Felt`: what failed reaches showed of the clutter, where it was touched and where it is not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lic_drake.control.taxels import TaxelLayout
from lic_drake.reach.sleeping import SkinAxes
from lic_drake.reach.trace import ReachTrace
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

TOUCH_N = 1.0
"""Force from which a taxel says where an object is, N."""

STILL_N = 2.5
"""An object that did not yield was pressed harder than this, N; the ground's friction is 2 N."""

HARD_N = 8.0
"""One that was pressed harder than this at the very end counts however briefly it was touched."""

STILL_SAMPLES = 5
"""Otherwise there must be so many loads of at least `TOUCH_N` on it."""

SAME_M = 0.02
"""An object has moved if it is found further away than this; less is the taxels' pitch, metres."""

APART_M = 0.015
"""Two objects of one kind are at least so far apart, metres."""

_EVERY = 5
"""One sample in so many of a reach says where the arm was."""


@dataclass(frozen=True)
class Felt:
    """What reaches showed, in W; d is 2 in the plane and 3 in space.

    Attributes:
        still: Centres of objects that did not yield, shape (k, d), metres.
        pushed: Last known centres of those that did, shape (m, d), metres.
        axes: Of the arm's skin.
        ends: Where they were, each shape (capsules, d, 2), metres.
    """

    still: Vector
    pushed: Vector
    axes: SkinAxes
    ends: tuple[Vector, ...]

    def gaps(self, p_WO: Vector) -> Vector:
        """Returns the least distances of the skin from points, shape (n, d), as (n,), metres."""
        near = np.full(len(p_WO), np.inf)
        for ends in self.ends:
            near = np.minimum(near, self.axes.gaps(ends, p_WO))
        return near


@dataclass(eq=False)
class _Track:
    """An object that is touched from sample to sample."""

    first: Vector
    last: Vector
    total: Vector
    count: int
    sample: int
    force: float


def feel(
    traces: Sequence[ReachTrace], arm: Arm, layout: TaxelLayout, radius: float, num_axes: int
) -> Felt:
    """Returns what reaches felt among objects of one radius, metres, in the order of the reaches.

    An object is beyond a loaded taxel, by its radius along the normal. Which loads are of the same
    object is known from sample to sample; an object that stays where it is has not yielded.
    """
    axes = SkinAxes(arm, num_axes)
    still: list[Vector] = []
    pushed: list[Vector] = []
    ends: list[Vector] = []
    for trace in traces:
        tracks = _tracks(trace, arm, layout, radius, num_axes)
        moved = [track for track in tracks if np.linalg.norm(track.last - track.first) > SAME_M]
        pushed = [track.last for track in moved]  # Those of earlier reaches were pushed on.
        final = len(trace.q) - 2
        for track in tracks:
            long = track.count >= STILL_SAMPLES
            hard = track.force > HARD_N and track.sample >= final
            if track not in moved and track.force > STILL_N and (long or hard):
                still.append(track.total / track.count)
        offset = trace.b0[:num_axes, np.newaxis]
        samples = [*trace.q[::_EVERY], *trace.q[-1:]]
        ends += [axes.ends(q) + offset for q in samples]
    fixed = _apart(still, [], num_axes)
    return Felt(fixed, _apart(pushed, list(fixed), num_axes), axes, tuple(ends))


def _tracks(
    trace: ReachTrace, arm: Arm, layout: TaxelLayout, radius: float, num_axes: int
) -> list[_Track]:
    """Returns the objects that a reach touched, centres in W."""
    tracks: list[_Track] = []
    for sample, (q, (taxels, forces)) in enumerate(zip(trace.q, trace.loaded, strict=True)):
        taxels, forces = taxels[forces > TOUCH_N], forces[forces > TOUCH_N]
        if not len(taxels):
            continue
        pose, link = arm.calc_pose(q), layout.link[taxels]
        p_LO = layout.p_LT[taxels] + radius * layout.n_L[taxels]
        p_RO = pose.p_RL[link] + (pose.R_RL[link] @ p_LO[..., np.newaxis])[..., 0]
        for centre, force in zip((p_RO + trace.b0)[:, :num_axes], forces, strict=True):
            apart = [float(np.linalg.norm(track.last - centre)) for track in tracks]
            if not apart or min(apart) >= SAME_M:
                tracks.append(_Track(centre, centre, centre, 1, sample, force))
                continue
            track = tracks[int(np.argmin(apart))]
            track.last = 0.7 * track.last + 0.3 * centre
            track.total = track.total + centre
            track.count, track.sample = track.count + 1, sample
            track.force = max(track.force, force)
    return tracks


def _apart(points: Sequence[Vector], others: Sequence[Vector], num_axes: int) -> Vector:
    """Returns the points that are apart from those before them and from others, shape (n, d)."""
    kept: list[Vector] = []
    for point in points:
        if all(np.linalg.norm(point - other) > APART_M for other in (*others, *kept)):
            kept.append(point)
    return np.array(kept).reshape(-1, num_axes)
