"""Movable objects sleep: they are left out of the scene until something comes near.

An object that nothing touches stands still, held by the ground's dry friction, and acts on nothing.
So nothing changes if it is not there while it is untouched, but a step of the plant costs a third.
Here is decided, from distances at the control instants, when an object has to wake up.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

WAKE_M = 0.02
"""A sleeping object wakes up when the gap between it and the arm, or a pushed object, is smaller.

Nothing that moves less than this in a control period can touch an object asleep: at the last
control instant before the touch the gap would have been smaller, and the object woken. In 11,000
control periods of random reaches no part of the arm moved further than 13 mm; that none does is
checked, see `MAX_MOVE_M`.
"""

MAX_MOVE_M = 0.8 * WAKE_M
"""Largest move of the skin or an object in a control period for which waking up is in time."""

MOVED_M = 1e-6
"""An object displaced by less than this counts as not moved."""

PARKING_M = 100.0
"""Distance from the base, along x and y, at which spare objects wait, metres."""


class MovedTooFarError(Exception):
    """Something moved further in a control period than `MAX_MOVE_M`."""


def can_sleep(instance: ClutterInstance) -> bool:
    """Tells whether the movable objects are all alike, so that a spare fits any."""
    shapes = {s for s, movable in zip(instance.shape, instance.movable, strict=True) if movable}
    if shapes not in ({"cylinder"}, {"sphere"}):
        return False
    size, mass = instance.size[instance.movable], instance.mass[instance.movable]
    return bool(np.all(size == size[0]) and np.all(mass == mass[0]))


def put_to_sleep(instance: ClutterInstance, spares: int) -> ClutterInstance:
    """Returns the fixed objects of an instance, followed by parked movable spares.

    Args:
        instance: An environment that can sleep.
        spares: Number of objects that can be awake at a time.
    """
    fixed, first = np.flatnonzero(~instance.movable), int(np.argmax(instance.movable))
    chosen = instance.subset(np.r_[fixed, np.full(spares, first)])
    n, p_WO = len(fixed), chosen.p_WO.copy()
    p_WO[n:, : instance.num_axes] = PARKING_M + np.arange(spares)[:, np.newaxis]
    return replace(chosen, p_WO=p_WO)


class SkinAxes:
    """The axes of an arm's skin capsules: seen from above, or in space.

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
        ends: Vector = pose.R_RL[self._link, :d] @ self._p_LA + pose.p_RL[self._link, :d, None]
        return ends

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
        gaps: Vector = (np.sqrt((d * d).sum(axis=2)) - self._radius).min(axis=0)
        return gaps


class SleepMonitor:
    """Follows the arm and the pushed objects, and says which objects have to wake up.

    Attributes:
        p_WO: Positions of all movable objects, shape (n, num_axes), metres.
    """

    def __init__(self, instance: ClutterInstance, axes: SkinAxes, q: Vector) -> None:
        self._axes = axes
        self._ends = axes.ends(q)
        self._p_WO_first = instance.p_WO[instance.movable, : instance.num_axes]
        self._radius = float(instance.size[instance.movable, 0].max(initial=0.0))
        self._is_awake = np.zeros(len(self._p_WO_first), dtype=bool)
        self._pushed = np.zeros_like(self._is_awake)
        self._slack = 0.0
        self.p_WO = self._p_WO_first.copy()
        self._awake: list[int] = []

    def look(self, q: Vector, p_WO_awake: Vector) -> list[int]:
        """Takes the state at a control instant; returns who wakes up, in ascending order.

        Args:
            q: Joint angles, shape (m,), radians.
            p_WO_awake: Positions of the objects that are awake, shape (k, num_axes), metres, in
                the order in which they woke up.

        Raises:
            MovedTooFarError: An object may have been touched while it was asleep.
        """
        ends = self._axes.ends(q)
        # No point of an axis moves further than the end that moves further.
        move = math.sqrt(((ends - self._ends) ** 2).sum(axis=1).max())
        if self._awake:
            d = p_WO_awake - self.p_WO[self._awake]
            move = max(move, math.sqrt((d * d).sum(axis=1).max()))
            self.p_WO[self._awake] = p_WO_awake
            pushed = self._is_pushed()
            if (pushed != self._pushed).any():
                # Whoever begins to move was no danger before.
                self._pushed, self._slack = pushed, 0.0
        if move > MAX_MOVE_M:
            raise MovedTooFarError(f"{move:.3f} m in a control period")
        self._ends = ends
        self._slack -= move
        if self._slack > 0.0:
            return []
        return self._wake_up()

    def _wake_up(self) -> list[int]:
        """Wakes the objects that the arm or a pushed object can reach, also through others.

        The gap of an object is that to the arm, or 0 if it was pushed, or the gap of another
        object plus the one between the two, whichever is the smallest.
        """
        gaps = np.maximum(self._axes.gaps(self._ends, self.p_WO) - self._radius, 0.0)
        gaps[self._pushed] = 0.0
        while True:
            passing = self._is_awake | (gaps < WAKE_M)
            d = self.p_WO[:, np.newaxis] - self.p_WO[passing]
            between = np.maximum(np.sqrt((d * d).sum(axis=2)) - 2.0 * self._radius, 0.0)
            chained = np.minimum(gaps, (between + gaps[passing]).min(axis=1, initial=np.inf))
            if (chained == gaps).all():
                break
            gaps = chained
        woken = np.flatnonzero((gaps < WAKE_M) & ~self._is_awake).tolist()
        self._awake += woken
        self._is_awake[woken] = True
        # Until something has moved that far, nobody else has to wake up.
        self._slack = float(gaps[~self._is_awake].min(initial=np.inf)) - WAKE_M
        return woken

    def _is_pushed(self) -> NDArray[np.bool_]:
        pushed: NDArray[np.bool_] = np.abs(self.p_WO - self._p_WO_first).max(axis=1) > MOVED_M
        return pushed
