"""`Felt`: what failed reaches showed of the clutter, where it was touched and where it is not."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
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

APART = 1.5
"""Fixed objects that are found are at least so many radii apart; they may be where two touch."""

OVERLAP_M = 0.002
"""Soft skin: an object may have been that deep in it, and in another object, metres."""

KNOWN_M = 0.01
"""A taxel as near as that to what is known is loaded by it, metres."""

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
    traces: Sequence[ReachTrace],
    arm: Arm,
    layout: TaxelLayout,
    radius: float,
    known: ClutterInstance,
) -> Felt:
    """Returns what reaches felt among objects of one radius, metres, in the order of the reaches.

    An object is beyond a loaded taxel, by its radius along the normal. Which loads are of the same
    object is known from sample to sample; an object that stays where it is has not yielded. The
    boxes of an instance are known, and what they load says nothing.
    """
    num_axes = known.num_axes
    axes = SkinAxes(arm, num_axes)
    still: list[Vector] = []
    pushed: list[Vector] = []
    ends: list[Vector] = []
    for trace in traces:
        tracks = _tracks(trace, arm, layout, radius, known)
        moved = [track for track in tracks if np.linalg.norm(track.last - track.first) > SAME_M]
        # What an earlier reach pushed is there unless it was pushed on; of two that overlap the
        # later one is there now.
        there = [p for p in pushed if all(np.linalg.norm(t.first - p) > radius for t in moved)]
        pushed = [*(t.last for t in sorted(moved, key=lambda t: -t.sample)), *there]
        final = len(trace.q) - 2
        for track in tracks:
            long = track.count >= STILL_SAMPLES
            hard = track.force > HARD_N and track.sample >= final
            if track not in moved and track.force > STILL_N and (long or hard):
                still.append(track.total / track.count)
        offset = trace.b0[:num_axes, np.newaxis]
        samples = [*trace.q[::_EVERY], *trace.q[-1:]]
        ends += [axes.ends(q) + offset for q in samples]
    fixed = _apart(still, [], APART * radius)
    loose = _apart(pushed, fixed, 2.0 * radius - OVERLAP_M)
    shape = (-1, num_axes)
    return Felt(np.reshape(fixed, shape), np.reshape(loose, shape), axes, tuple(ends))


def _tracks(
    trace: ReachTrace, arm: Arm, layout: TaxelLayout, radius: float, known: ClutterInstance
) -> list[_Track]:
    """Returns the objects that a reach touched, centres in W."""
    tracks: list[_Track] = []
    for sample, (q, (taxels, forces)) in enumerate(zip(trace.q, trace.loaded, strict=True)):
        taxels, forces = taxels[forces > TOUCH_N], forces[forces > TOUCH_N]
        if not len(taxels):
            continue
        pose, link = arm.calc_pose(q), layout.link[taxels]
        R_WL = pose.R_RL[link]
        p_WT = trace.b0 + pose.p_RL[link] + _turned(R_WL, layout.p_LT[taxels])
        p_WO = p_WT + radius * _turned(R_WL, layout.n_L[taxels])
        unknown = _distances(p_WT, known) > KNOWN_M
        for centre, force in zip(p_WO[unknown, : known.num_axes], forces[unknown], strict=True):
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


def _turned(R: Vector, v: Vector) -> Vector:
    """Returns vectors v, shape (n, 3), turned by R, shape (n, 3, 3)."""
    return np.asarray((R @ v[..., np.newaxis])[..., 0])


def _distances(p_W: Vector, known: ClutterInstance) -> Vector:
    """Returns the distances of points, shape (n, 3), from the nearest known box, shape (n,)."""
    box = [i for i, shape in enumerate(known.shape) if shape == "box"]
    offset = p_W[:, np.newaxis] - known.p_WO[box]
    c, s = np.cos(known.yaw[box]), np.sin(known.yaw[box])
    x, y = c * offset[..., 0] + s * offset[..., 1], c * offset[..., 1] - s * offset[..., 0]
    beyond = np.abs(np.stack([x, y, offset[..., 2]], axis=-1)) - 0.5 * known.size[box]
    beyond = np.maximum(beyond[..., : known.num_axes], 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=2).min(axis=1, initial=np.inf))


def _apart(points: Sequence[Vector], others: Sequence[Vector], distance: float) -> list[Vector]:
    """Returns the points that are so far from those before them and from others, metres."""
    kept: list[Vector] = []
    for point in points:
        if all(np.linalg.norm(point - other) > distance for other in (*others, *kept)):
            kept.append(point)
    return kept
