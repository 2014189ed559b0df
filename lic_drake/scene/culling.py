"""Leaves out objects that a reach cannot touch, and tells afterwards whether that was right."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.instance import ClutterInstance

KEEP_MARGIN_M = 0.08
"""Objects whose centre is further than the arm's reach plus this are left out."""

SLACK_M = 0.02
"""What an object may move between two samples: one control period at the arm's 0.5 m/s."""


def select_near(instance: ClutterInstance, reach_m: float) -> NDArray[np.bool_]:
    """Returns which objects to keep, shape (n,).

    Everything that the arm can touch is kept. An object further out can only matter if a movable
    one is pushed against it, which `reaches_left_out` detects.
    """
    distance = np.linalg.norm(instance.p_WO[:, :2], axis=1)
    return distance - outer_radius(instance) <= reach_m + KEEP_MARGIN_M


def take(instance: ClutterInstance, keep: NDArray[np.bool_]) -> ClutterInstance:
    """Returns the instance with only the objects in `keep`, in their order."""
    return replace(
        instance,
        shape=tuple(s for s, kept in zip(instance.shape, keep, strict=True) if kept),
        size=instance.size[keep],
        p_WO=instance.p_WO[keep],
        yaw=instance.yaw[keep],
        mass=instance.mass[keep],
        movable=instance.movable[keep],
    )


def reaches_left_out(
    instance: ClutterInstance, keep: NDArray[np.bool_], outermost_m: float
) -> bool:
    """Tells whether a kept object may have touched one that was left out.

    If it returns False, no movable object ever came near a left-out one, so the left-out objects
    stood still without contact all the time and the reach is the same as with them.

    Args:
        instance: The whole environment.
        keep: What was simulated, shape (n,).
        outermost_m: Largest distance from the base that the centre of a moved object had at any
            control step, metres; 0 if none was moved.
    """
    if np.all(keep) or outermost_m == 0.0:
        return False
    radius = outer_radius(instance)
    inner_edge = np.linalg.norm(instance.p_WO[~keep, :2], axis=1) - radius[~keep]
    moved = keep & instance.movable
    outer_edge = outermost_m + (radius[moved].max() if np.any(moved) else 0.0)
    return bool(outer_edge + SLACK_M >= inner_edge.min())


def outer_radius(instance: ClutterInstance) -> NDArray[np.float64]:
    """Returns the radius of each object's enclosing circle in the plane, shape (n,), metres."""
    is_box = np.array([shape == "box" for shape in instance.shape], dtype=bool)
    half_diagonal = 0.5 * np.hypot(instance.size[:, 0], instance.size[:, 1])
    return np.where(is_box, half_diagonal, instance.size[:, 0])
