"""`ClutterInstance`: one drawn environment as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.stems import Stems
from lic_drake.types import Vector

SHAPES = ("cylinder", "box", "sphere")
"""Shape names: an upright cylinder (radius, length), a box (full edges), a sphere (radius)."""


@dataclass(frozen=True, kw_only=True)
class ClutterInstance:
    """The objects of one environment, in the world frame W, SI units.

    Attributes:
        category: Name of the clutter category that drew it.
        shape: n names out of `SHAPES`.
        size: Shape (n, 3), metres: cylinder (radius, length, 0), box (x, y, z edges), sphere
            (radius, 0, 0).
        p_WO: Positions of the objects' centres, shape (n, 3), metres.
        yaw: Rotations of the objects about Wz, shape (n,), radians.
        mass: Shape (n,), kg; not used for fixed objects.
        movable: Shape (n,), False for objects fixed to the ground.
        p_WG: The goal that the environment offers, shape (3,), metres; None where a goal may lie
            anywhere.
        p_WA: Centres of the apertures through which a robot may reach, shape (k, 3), metres; None
            where the front is open.
        stems: Springy stems with leaves beside the objects; None where nothing grows.
        material: What each object is made of, for its looks; None where that does not matter.
    """

    category: str
    shape: tuple[str, ...]
    size: Vector
    p_WO: Vector
    yaw: Vector
    mass: Vector
    movable: NDArray[np.bool_]
    p_WG: Vector | None = None
    p_WA: Vector | None = None
    stems: Stems | None = None
    material: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        n = len(self.shape)
        for name, expected in (
            ("size", (n, 3)),
            ("p_WO", (n, 3)),
            ("yaw", (n,)),
            ("mass", (n,)),
            ("movable", (n,)),
        ):
            value = getattr(self, name)
            if value.shape != expected:
                raise ValueError(f"{name} has shape {value.shape}, expected {expected}")
        if self.p_WG is not None and self.p_WG.shape != (3,):
            raise ValueError(f"p_WG has shape {self.p_WG.shape}, expected (3,)")
        if self.p_WA is not None and self.p_WA.shape[1:] != (3,):
            raise ValueError(f"p_WA has shape {self.p_WA.shape}, expected (k, 3)")
        if self.material is not None and len(self.material) != n:
            raise ValueError(f"material has {len(self.material)} names, expected {n}")
        unknown = set(self.shape) - set(SHAPES)
        if unknown:
            raise ValueError(f"unknown shapes {sorted(unknown)}; known: {SHAPES}")

    @property
    def num_objects(self) -> int:
        """Number of objects, fixed and movable."""
        return len(self.shape)

    @property
    def num_axes(self) -> int:
        """In how many directions movable objects move: 2 on the ground, 3 where spheres float.

        Stems bend about 2 axes.
        """
        return 3 if "sphere" in self.shape else 2

    def translated(self, offset: Vector) -> "ClutterInstance":
        """Returns the same environment moved by an offset, shape (3,), metres."""
        return replace(
            self,
            p_WO=self.p_WO + offset,
            p_WG=None if self.p_WG is None else self.p_WG + offset,
            p_WA=None if self.p_WA is None else self.p_WA + offset,
            stems=None if self.stems is None else self.stems.translated(offset),
        )

    def picked(self, indices: NDArray[np.intp]) -> "ClutterInstance":
        """Returns the environment with some of its objects, in this order; repeats are allowed."""
        return replace(
            self,
            shape=tuple(self.shape[i] for i in indices),
            size=self.size[indices],
            p_WO=self.p_WO[indices],
            yaw=self.yaw[indices],
            mass=self.mass[indices],
            movable=self.movable[indices],
            material=None if self.material is None else tuple(self.material[i] for i in indices),
        )

    def with_objects_at(self, p_WO: Vector) -> "ClutterInstance":
        """Returns the environment with its movable objects elsewhere.

        Stems are as before: they spring back as soon as nothing holds them.

        Args:
            p_WO: Their positions along the axes in which they move, shape (movable objects,
                num_axes), metres.
        """
        if self.stems is not None:
            return self
        moved = self.p_WO.copy()
        moved[self.movable, : self.num_axes] = p_WO
        return replace(self, p_WO=moved)
