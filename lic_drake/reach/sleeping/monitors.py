"""Decides from distances at the control instants when a sleeping object or stem has to wake up.

What nothing touches stands still, held by the ground's dry friction or by its spring, and acts on
nothing. So nothing changes if it is left out of the plant while it is untouched.
"""

import math

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, Stems
from lic_drake.robots.arm import Arm
from lic_drake.types import BoolVector, IntVector, Vector

WAKE_M = 0.02
"""What sleeps wakes up when the gap between it and the arm, or a pushed object, is smaller.

Nothing that moves less than this in a control period can touch an object asleep: at the last
control instant before the touch the gap would have been smaller, and the object woken. In 11,000
control periods of random reaches no part of the arm moved further than 13 mm; that none does is
checked, see `MAX_MOVE_M`.
"""

MAX_MOVE_M = 0.8 * WAKE_M
"""Largest move of the skin or an object in a control period for which waking up is in time."""

MOVED_M = 1e-6
"""An object displaced by less than this counts as not moved."""

GROUP_M = 0.08
"""Where a stem wakes up, so do all whose gap is at most this much larger: waking one costs as much
as waking many."""

_BALL_STEP_M = 0.03


class MovedTooFarError(Exception):
    """Something moved further in a control period than `MAX_MOVE_M`."""


class SkinAxes:
    """The axes of the capsules around an arm's skin: seen from above, or in space.

    Args:
        arm: The arm.
        num_axes: 2 for what slides on the ground, 3 for what floats.
    """

    def __init__(self, arm: Arm, num_axes: int = 2) -> None:
        self._num_axes = num_axes
        capsules = [shape.enclosing_capsule() for shape in arm.skin]
        half = np.array([0.5 * c.size[1] * c.R_LS[:, 2] for c in capsules])
        centre = np.array([c.p_LS for c in capsules])
        self._arm = arm
        self._link = np.array([arm.link_names.index(c.link) for c in capsules])
        self._p_LA = np.stack([centre - half, centre + half], axis=-1)
        self._radius = np.array([c.size[0] for c in capsules])[:, np.newaxis]

    def ends(self, q: Vector) -> Vector:
        """Returns the ends of the axes, shape (capsules, num_axes, 2): x, y, .. of both, metres."""
        pose = self._arm.calc_pose(q)
        d = self._num_axes
        return pose.R_RL[self._link, :d] @ self._p_LA + pose.p_RL[self._link, :d, np.newaxis]

    def gaps(self, ends: Vector, p_WO: Vector) -> Vector:
        """Returns the distances from the skin to points, shape (n,), metres.

        Args:
            ends: What `ends` returned.
            p_WO: Shape (n, num_axes), metres.
        """
        along = ends[:, :, 1] - ends[:, :, 0]
        d = p_WO - ends[:, np.newaxis, :, 0]
        share = (d @ along[:, :, np.newaxis])[..., 0] / (along * along).sum(axis=1, keepdims=True)
        d -= np.minimum(np.maximum(share, 0.0), 1.0)[..., np.newaxis] * along[:, np.newaxis]
        return (np.sqrt((d * d).sum(axis=2)) - self._radius).min(axis=0)


class _Monitor:
    """Follows the arm, and looks only when something has moved far enough to matter.

    Attributes:
        is_awake: What is awake, shape (n,).
    """

    def __init__(self, axes: SkinAxes, count: int) -> None:
        self._axes = axes
        self.is_awake = np.zeros(count, dtype=bool)
        self._ends: Vector | None = None
        self._slack = 0.0

    def _must_look(self, q: Vector, move: float = 0.0) -> bool:
        """Takes the joint angles and the largest move of an object, metres, at a control instant.

        Raises:
            MovedTooFarError: Something may have been touched while it was asleep.
        """
        ends = self._axes.ends(q)
        if self._ends is not None:
            # No point of an axis moves further than the end that moves further.
            move = max(move, math.sqrt(((ends - self._ends) ** 2).sum(axis=1).max()))
        if move > MAX_MOVE_M:
            raise MovedTooFarError(f"{move:.3f} m in a control period")
        self._ends = ends
        self._slack -= move
        return self._slack <= 0.0

    def _wake(self, woken: BoolVector, gaps: Vector) -> None:
        self.is_awake |= woken
        # Until something has moved that far, nothing else has to wake up.
        self._slack = float(gaps[~self.is_awake].min(initial=np.inf)) - WAKE_M


class ObjectMonitor(_Monitor):
    """Says which movable objects have to wake up: those near the arm or pushed objects.

    Attributes:
        p_WO: Positions of all movable objects, shape (n, num_axes), metres.
    """

    def __init__(self, instance: ClutterInstance, axes: SkinAxes) -> None:
        self._p_WO_first = instance.p_WO[instance.movable, : instance.num_axes]
        super().__init__(axes, len(self._p_WO_first))
        self._radius = float(instance.size[instance.movable, 0].max(initial=0.0))
        self._pushed = np.zeros_like(self.is_awake)
        self.p_WO = self._p_WO_first.copy()
        self.awake: list[int] = []

    def look(self, q: Vector, p_WO_awake: Vector) -> list[int]:
        """Takes the state at a control instant; returns what wakes up, in ascending order.

        Args:
            q: Joint angles, shape (m,), radians.
            p_WO_awake: Positions of the objects that are awake, shape (k, num_axes), metres, in
                the order in which they woke up.

        Raises:
            MovedTooFarError: An object may have been touched while it was asleep.
        """
        move = 0.0
        if self.awake:
            d = p_WO_awake - self.p_WO[self.awake]
            move = math.sqrt((d * d).sum(axis=1).max())
            self.p_WO[self.awake] = p_WO_awake
            pushed = np.abs(self.p_WO - self._p_WO_first).max(axis=1) > MOVED_M
            if (pushed != self._pushed).any():
                # What begins to move was no danger before.
                self._pushed, self._slack = pushed, 0.0
        if not self._must_look(q, move):
            return []
        assert self._ends is not None
        gaps = self._chained_gaps(self._ends)
        woken = (gaps < WAKE_M) & ~self.is_awake
        self._wake(woken, gaps)
        indices: list[int] = np.flatnonzero(woken).tolist()
        self.awake += indices
        return indices

    def _chained_gaps(self, ends: Vector) -> Vector:
        """Returns how far arm and pushed objects are from each object, also through others.

        The gap of an object is that to the arm, or 0 if it was pushed, or the gap of another
        object plus the one between the two, whichever is the smallest.
        """
        gaps = np.maximum(self._axes.gaps(ends, self.p_WO) - self._radius, 0.0)
        gaps[self._pushed] = 0.0
        while True:
            passing = self.is_awake | (gaps < WAKE_M)
            d = self.p_WO[:, np.newaxis] - self.p_WO[passing]
            between = np.maximum(np.sqrt((d * d).sum(axis=2)) - 2.0 * self._radius, 0.0)
            chained = np.minimum(gaps, (between + gaps[passing]).min(axis=1, initial=np.inf))
            if (chained == gaps).all():
                return gaps
            gaps = chained


class StemMonitor(_Monitor):
    """Says which stems have to wake up: those near the arm, as stems do not touch one another."""

    def __init__(self, stems: Stems, axes: SkinAxes) -> None:
        super().__init__(axes, stems.num_stems)
        self._p_WB, self._radius, self._stem = _balls(stems)

    def look(self, q: Vector) -> bool:
        """Takes the joint angles at a control instant; returns whether any stem wakes up.

        Raises:
            MovedTooFarError: A stem may have been touched while it was asleep.
        """
        if not self._must_look(q):
            return False
        assert self._ends is not None
        gaps = np.full(len(self.is_awake), np.inf)
        near = self._axes.gaps(self._ends, self._p_WB) - self._radius
        np.minimum.at(gaps, self._stem, near)
        gaps[self.is_awake] = np.inf
        woken = np.zeros_like(self.is_awake)
        if gaps.min(initial=np.inf) < WAKE_M:
            woken = gaps < WAKE_M + GROUP_M
        self._wake(woken, gaps)
        return bool(woken.any())


def _balls(stems: Stems) -> tuple[Vector, Vector, IntVector]:
    """Returns balls that hold stems and leaves: centres, radii, and the stem of each."""
    centres, radii, owners = [], [], []
    for i, length in enumerate(stems.length):
        count = int(np.ceil(length / _BALL_STEP_M))
        along = (np.arange(count) + 0.5) * length / count
        centres.append(stems.p_WH[i] + np.outer(along, stems.R_WS[i][:, 2]))
        radii.append(np.full(count, np.hypot(0.5 * length / count, stems.radius[i])))
        owners.append(np.full(count, i))
    stem = stems.leaf_stem
    centres.append(stems.p_WH[stem] + np.einsum("kij,kj->ki", stems.R_WS[stem], stems.p_SL))
    radii.append(0.5 * np.linalg.norm(stems.leaf_size, axis=1))
    owners.append(stem)
    return np.vstack(centres), np.concatenate(radii), np.concatenate(owners)
