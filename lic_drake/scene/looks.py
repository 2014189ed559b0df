"""Colours, RGBA."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.types import Vector

FIXED_COLOR = np.array([0.55, 0.25, 0.20, 1.0])
"""Of fixed objects."""
MOVABLE_COLOR = np.array([0.95, 0.70, 0.35, 1.0])
"""Of movable objects."""
STEM_COLOR = np.array([0.30, 0.42, 0.16, 1.0])
"""Of elastic stems."""
BRANCH_COLOR = np.array([0.33, 0.24, 0.15, 1.0])
"""Of fixed branches."""
LEAF_COLORS = np.array(
    [[0.13, 0.45, 0.12, 1.0], [0.20, 0.55, 0.16, 1.0], [0.30, 0.60, 0.20, 1.0]],
)
"""Of leaves, alternating."""

MATERIAL_COLORS = {
    "wood": np.array([0.43, 0.27, 0.14, 1.0]),
    "clay": np.array([0.52, 0.30, 0.24, 1.0]),
    "cardboard": np.array([0.70, 0.55, 0.38, 1.0]),
}
"""Of the materials that a `ClutterInstance` may name."""


def object_color(instance: ClutterInstance, i: int) -> Vector:
    """Returns the colour of an object, shape (4,), by its material or else by its mobility."""
    by_mobility = MOVABLE_COLOR if instance.movable[i] else FIXED_COLOR
    return MATERIAL_COLORS.get(instance.material[i], by_mobility)
