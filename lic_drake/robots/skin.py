"""The shapes of an arm's surface, which carry its tactile skin."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from lic_drake.types import Vector

_ALONG = (
    np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    np.eye(3),
)
"""Rotations R_SC that lay the capsule's axis Cz along Sx, Sy and Sz."""


@dataclass(frozen=True, kw_only=True)
class SkinShape:
    """A capsule, box or cylinder of the arm's surface; its frame S lies in its centre.

    Attributes:
        link: Name of the body that carries it.
        kind: "capsule" or "cylinder" (axis along Sz), or "box".
        size: Radius and length of the cylindrical part, or edges along Sx, Sy and Sz, metres.
        R_LS: Rotation of S in the link frame, shape (3, 3).
        p_LS: Position of the centre in the link frame, shape (3,), metres.
    """

    link: str
    kind: Literal["capsule", "box", "cylinder"]
    size: tuple[float, ...]
    R_LS: Vector
    p_LS: Vector

    def enclosing_capsule(self) -> "SkinShape":
        """Returns a capsule that holds the whole shape, its axis along the longest edge."""
        if self.kind != "box":
            return replace(self, kind="capsule")
        axis = int(np.argmax(self.size))
        radius = 0.5 * math.hypot(*np.delete(self.size, axis))
        return replace(
            self, kind="capsule", size=(radius, self.size[axis]), R_LS=self.R_LS @ _ALONG[axis]
        )


def read_skin(
    plant: MultibodyPlant, inspector: SceneGraphInspector, link: RigidBody
) -> list[SkinShape]:
    """Returns the collision shapes of a link.

    Raises:
        ValueError: One of them is neither a capsule nor a box nor a cylinder.
    """
    shapes = []
    for geometry in plant.GetCollisionGeometriesForBody(link):
        shape, X_LS = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
        kind: Literal["capsule", "box", "cylinder"]
        size: tuple[float, ...]
        if isinstance(shape, Box):
            kind, size = "box", tuple(shape.size().tolist())
        elif isinstance(shape, Capsule | Cylinder):
            kind = "capsule" if isinstance(shape, Capsule) else "cylinder"
            size = (shape.radius(), shape.length())
        else:
            raise ValueError(
                f"{link.name()}: skin must be capsules, boxes or cylinders, found"
                f" {type(shape).__name__}"
            )
        # Copies: arrays that Drake returns may keep the plant alive.
        R_LS, p_LS = np.array(X_LS.rotation().matrix()), np.array(X_LS.translation())
        shapes.append(SkinShape(link=link.name(), kind=kind, size=size, R_LS=R_LS, p_LS=p_LS))
    return shapes
