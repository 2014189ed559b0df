"""The shapes of an arm's surface, which carries tactile skin."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from pydrake.geometry import Box, Capsule, Cylinder, SceneGraphInspector, Sphere
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
    """A shape of the arm's surface, which carries tactile skin; frame S lies in its centre.

    Attributes:
        link: Name of the body that carries it.
        kind: "capsule" or "cylinder" (axis along Sz), or "box".
        size: Radius and length of the cylindrical part, or edges along Sx, Sy and Sz, metres.
        R_LS: Rotation of S in the link frame, shape (3, 3).
        p_LS: Position of the centre in the link frame, shape (3,), metres.
    """

    link: str
    kind: str
    size: tuple[float, ...]
    R_LS: Vector
    p_LS: Vector

    def enclosing_capsule(self) -> "SkinShape":
        """Returns a capsule that holds the whole shape, its axis along the longest edge."""
        if self.kind != "box":
            return replace(self, kind="capsule")
        axis = int(np.argmax(self.size))
        size = (0.5 * math.hypot(*np.delete(self.size, axis)), self.size[axis])
        return replace(self, kind="capsule", size=size, R_LS=self.R_LS @ _ALONG[axis])


def read_skin(
    plant: MultibodyPlant, inspector: SceneGraphInspector, link: RigidBody
) -> Iterator[SkinShape]:
    """Yields the collision shapes of a link."""
    for geometry in plant.GetCollisionGeometriesForBody(link):
        shape, X_LS = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
        kind = type(shape).__name__
        if isinstance(shape, Box):
            size = tuple(shape.size().tolist())
        elif isinstance(shape, Capsule | Cylinder):
            size = (shape.radius(), shape.length())
        elif isinstance(shape, Sphere):
            kind, size = "capsule", (shape.radius(), 0.0)
        else:
            raise ValueError(
                f"{link.name()}: skin must be capsules, boxes, cylinders or spheres, found {kind};"
                " give the link capsules in a robot file"
            )
        # Copies: arrays that Drake returns may keep the plant alive.
        R_LS, p_LS = np.array(X_LS.rotation().matrix()), np.array(X_LS.translation())
        yield SkinShape(link=link.name(), kind=kind.lower(), size=size, R_LS=R_LS, p_LS=p_LS)
