"""Stems sleep: they are not in the scene at all until the arm comes near.

A stem that nothing touches stands still in its place, and acts on nothing: stems and leaves do not
touch one another. So nothing changes if it is left out while it is untouched, but a step of the
plant costs a half to a third. Here is decided, from distances at the control instants, when a stem
has to be there.
"""

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.stems import Stems
from lic_drake.scene.sleep import MAX_MOVE_M, WAKE_M, MovedTooFarError, SkinAxes
from lic_drake.types import Vector

GROUP_M = 0.08
"""Where a stem wakes up, so do all whose gap is this much larger: to wake one costs as much as to
wake many."""

_BALL_STEP_M = 0.03


class StemMonitor:
    """Follows the arm, and says which stems have to wake up.

    Attributes:
        is_awake: Which stems are awake, shape (m,).
    """

    def __init__(self, stems: Stems, axes: SkinAxes) -> None:
        """Sets up a monitor with all stems asleep.

        Args:
            stems: The stems, in the frame in which the arm stands at the origin.
            axes: The arm, in space.
        """
        self._axes = axes
        self._p_WB, self._radius, self._stem = _balls(stems)
        self.is_awake = np.zeros(stems.num_stems, dtype=bool)
        self._ends: Vector | None = None
        self._slack = 0.0

    def look(self, q: Vector) -> NDArray[np.bool_]:
        """Takes the joint angles at a control instant; returns who wakes up, shape (m,).

        Raises:
            MovedTooFarError: A stem may have been touched while it was asleep.
        """
        ends = self._axes.ends(q)
        if self._ends is not None:
            # No point of an axis moves further than the end that moves further.
            move = float(np.linalg.norm(ends - self._ends, axis=1).max())
            if move > MAX_MOVE_M:
                raise MovedTooFarError(f"{move:.3f} m in a control period")
            self._slack -= move
        self._ends = ends
        if self._slack > 0.0:
            return np.zeros_like(self.is_awake)
        return self._wake_up(ends)

    def wake_near(self, q: Vector) -> NDArray[np.bool_]:
        """Wakes all stems near the arm at joint angles q, wherever it was; as `look`."""
        self._ends, self._slack = None, 0.0
        return self.look(q)

    def _wake_up(self, ends: Vector) -> NDArray[np.bool_]:
        gaps = np.full(len(self.is_awake), np.inf)
        near = self._axes.gaps(ends, self._p_WB) - self._radius
        np.minimum.at(gaps, self._stem, near)
        gaps[self.is_awake] = np.inf
        woken: NDArray[np.bool_] = np.zeros_like(self.is_awake)
        if gaps.min(initial=np.inf) < WAKE_M:
            woken = gaps < WAKE_M + GROUP_M
            self.is_awake |= woken
        # Until something has moved that far, nobody else has to wake up.
        self._slack = float(gaps[~self.is_awake].min(initial=np.inf)) - WAKE_M
        return woken


def _balls(stems: Stems) -> tuple[Vector, Vector, NDArray[np.intp]]:
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
