"""What things look like."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.types import Vector

Color = Vector
"""RGBA, shape (4,), each 0 to 1."""

FIXED_COLOR = np.array([0.55, 0.25, 0.20, 1.0])
"""Of objects that cannot be pushed, RGBA."""
MOVABLE_COLOR = np.array([0.95, 0.70, 0.35, 1.0])
"""Of objects that can be pushed, RGBA."""
STEM_COLOR = np.array([0.30, 0.42, 0.16, 1.0])
"""Of springy stems, RGBA."""
BRANCH_COLOR = np.array([0.33, 0.24, 0.15, 1.0])
"""Of branches that do not bend, RGBA."""
LEAF_COLORS = np.array(
    [[0.13, 0.45, 0.12, 1.0], [0.20, 0.55, 0.16, 1.0], [0.30, 0.60, 0.20, 1.0]],
)
"""Leaves take them in turn."""

MATERIAL_COLORS = {
    "wood": np.array([0.43, 0.27, 0.14, 1.0]),
    "clay": np.array([0.52, 0.30, 0.24, 1.0]),
    "cardboard": np.array([0.70, 0.55, 0.38, 1.0]),
}
"""Colours of the materials that a `ClutterInstance` may name."""


def object_color(instance: ClutterInstance, i: int) -> Color:
    """Returns the colour of an object: its material's, or whether it can be pushed."""
    by_mobility = MOVABLE_COLOR if instance.movable[i] else FIXED_COLOR
    return MATERIAL_COLORS.get(instance.material[i], by_mobility)
