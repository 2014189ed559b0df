"""`ClutterInstance`: one drawn environment as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.clutter.stems import Stems
from lic_drake.types import BoolVector, IntVector, Vector, check_shapes

SHAPES = ("cylinder", "box", "sphere")
"""Shape names: an upright cylinder (radius, length), a box (full edges), a sphere (radius)."""


@dataclass(frozen=True, kw_only=True)
class ClutterInstance:
    """The objects of one environment, in the world frame W, SI units.

    `make_objects` makes objects of one kind, `join` puts several kinds together.

    Attributes:
        shape: n names out of `SHAPES`.
        size: Shape (n, 3), metres: cylinder (radius, length, 0), box (x, y, z edges), sphere
            (radius, 0, 0).
        p_WO: Positions of the objects' centres, shape (n, 3), metres.
        yaw: Rotations of the objects about Wz, shape (n,), radians.
        mass: Shape (n,), kg; not used for fixed objects.
        movable: Shape (n,), False for objects fixed to the ground.
        material: What each object is made of, for its looks; may be empty.
        p_WG: The goal that the environment offers, shape (3,), metres; None where a goal may lie
            anywhere.
        p_WA: Centres of the apertures through which a robot may reach, shape (k, 3), metres; None
            where the front is open.
        stems: Springy stems with leaves beside the objects; None where nothing grows.
    """

    shape: tuple[str, ...]
    size: Vector
    p_WO: Vector
    yaw: Vector
    mass: Vector
    movable: BoolVector
    material: tuple[str, ...]
    p_WG: Vector | None = None
    p_WA: Vector | None = None
    stems: Stems | None = None

    def __post_init__(self) -> None:
        n = len(self.shape)
        check_shapes(self, size=(n, 3), p_WO=(n, 3), yaw=(n,), mass=(n,), movable=(n,))
        check_shapes(self, material=(n,), p_WG=(3,), p_WA=(None, 3))
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

    def subset(self, indices: IntVector) -> "ClutterInstance":
        """Returns the environment with some of its objects, in this order; repeats are allowed."""
        return replace(
            self,
            shape=tuple(self.shape[i] for i in indices),
            size=self.size[indices],
            p_WO=self.p_WO[indices],
            yaw=self.yaw[indices],
            mass=self.mass[indices],
            movable=self.movable[indices],
            material=tuple(self.material[i] for i in indices),
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


def make_objects(
    shape: str,
    size: ArrayLike,
    p_WO: ArrayLike,
    *,
    yaw: ArrayLike = 0.0,
    mass: ArrayLike = 1.0,
    movable: ArrayLike = False,
    material: str = "",
) -> ClutterInstance:
    """Returns n objects of one shape; a value may be given once for all of them.

    Args:
        shape: One of `SHAPES`.
        size: As many numbers as the shape has, for all or for each object, metres.
        p_WO: Centres, shape (n, 3), or (n, 2) for objects centred at z = 0, metres.
        yaw: Rotation about Wz, shape (n,) or a number, radians.
        mass: Shape (n,) or a number, kg.
        movable: Shape (n,) or one truth value.
        material: What they are made of, for their looks.
    """
    p_WO = np.atleast_2d(np.asarray(p_WO, dtype=float))
    n = len(p_WO)
    return ClutterInstance(
        shape=(shape,) * n,
        size=_filled(np.atleast_2d(np.asarray(size, dtype=float)), n),
        p_WO=_filled(p_WO, n),
        yaw=np.full(n, yaw, dtype=float),
        mass=np.full(n, mass, dtype=float),
        movable=np.full(n, movable, dtype=bool),
        material=(material,) * n,
    )


def join(
    *parts: ClutterInstance,
    p_WG: Vector | None = None,
    p_WA: Vector | None = None,
    stems: Stems | None = None,
) -> ClutterInstance:
    """Returns an environment with the objects of all parts, in order; see `ClutterInstance`."""
    return ClutterInstance(
        shape=tuple(shape for part in parts for shape in part.shape),
        size=np.vstack([np.empty((0, 3)), *(part.size for part in parts)]),
        p_WO=np.vstack([np.empty((0, 3)), *(part.p_WO for part in parts)]),
        yaw=np.concatenate([np.empty(0), *(part.yaw for part in parts)]),
        mass=np.concatenate([np.empty(0), *(part.mass for part in parts)]),
        movable=np.concatenate([np.empty(0, dtype=bool), *(part.movable for part in parts)]),
        material=tuple(material for part in parts for material in part.material),
        p_WG=p_WG,
        p_WA=p_WA,
        stems=stems,
    )


def _filled(rows: Vector, n: int) -> Vector:
    """Returns n rows of three numbers, those that are missing 0."""
    filled = np.zeros((n, 3))
    filled[:, : rows.shape[1]] = rows
    return filled
