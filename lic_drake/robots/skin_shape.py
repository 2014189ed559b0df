"""Boxes and cylinders of an arm's surface, where capsules do not fit."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lic_drake.robots.arm import SkinCapsule
from lic_drake.types import Vector

_ALONG = (
    np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    np.eye(3),
)
"""Rotations R_SC that lay the capsule's axis Cz along Sx, Sy and Sz."""


@dataclass(frozen=True, kw_only=True)
class SkinShape:
    """A box or a cylinder of the arm's surface; its frame S lies in its centre.

    Attributes:
        link: Name of the body that carries it.
        kind: "box" or "cylinder" (axis along Sz).
        size: Edges along Sx, Sy and Sz of a box, radius and length of a cylinder, metres.
        R_LS: Rotation of S in the link frame, shape (3, 3).
        p_LS: Position of the centre in the link frame, shape (3,), metres.
    """

    link: str
    kind: Literal["box", "cylinder"]
    size: tuple[float, ...]
    R_LS: Vector
    p_LS: Vector

    def enclosing_capsule(self) -> SkinCapsule:
        """Returns a capsule that holds the whole shape, its axis along the longest edge."""
        if self.kind == "cylinder":
            axis, (radius, length) = 2, self.size
        else:
            axis = int(np.argmax(self.size))
            length = self.size[axis]
            radius = 0.5 * math.hypot(*np.delete(self.size, axis))
        return SkinCapsule(
            link=self.link,
            radius=radius,
            length=length,
            R_LC=self.R_LS @ _ALONG[axis],
            p_LC=self.p_LS,
        )
