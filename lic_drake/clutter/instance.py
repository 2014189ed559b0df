"""`ClutterInstance` and `Stems`: one sampled environment as plain arrays."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.errors import ScenarioError
from lic_drake.types import BoolVector, IntVector, Vector, check_shapes

SHAPES = ("cylinder", "box", "sphere")
"""Shape names: an upright cylinder (radius, length), a box (full edges), a sphere (radius)."""
MAX_TRIES = 10_000
"""Attempts per disc before the rectangle counts as full."""
_ARRAYS = ("size", "p_WO", "yaw", "mass", "movable")
_NAMES = ("shape", "material")


@dataclass(frozen=True, kw_only=True)
class Stems:
    """m straight stems with elastic roots, and k leaves on them, in W, SI units.

    A stem is a rigid cylinder on a spring hinge at its root H; its frame S has its origin there and
    Sz along the stem.

    Attributes:
        p_WH: Roots, shape (m, 3), metres.
        R_WS: Orientations at rest, shape (m, 3, 3).
        mass: Of each stem with its leaves, shape (m,), kg.
        stiffness: Of each hinge about any axis across the stem, Nm/rad; inf for a fixed branch.
        damping: Of each hinge, Nms/rad.
        leaf_stem: Index of each leaf's stem, shape (k,).
        p_SL: Centres of the leaves in S, shape (k, 3), metres.
        R_SL: Their orientations, shape (k, 3, 3); Lx along the leaf, Lz across it.
        leaf_size: Full edges along Lx, Ly and Lz, shape (k, 3), metres.
    """

    p_WH: Vector
    R_WS: Vector
    length: Vector
    radius: Vector
    mass: Vector
    stiffness: Vector
    damping: Vector
    leaf_stem: IntVector
    p_SL: Vector
    R_SL: Vector
    leaf_size: Vector

    def __post_init__(self) -> None:
        m, k = len(self.p_WH), len(self.leaf_stem)
        numbers = dict.fromkeys(("length", "radius", "mass", "stiffness", "damping"), (m,))
        check_shapes(self, p_WH=(m, 3), R_WS=(m, 3, 3), **numbers)
        check_shapes(self, p_SL=(k, 3), R_SL=(k, 3, 3), leaf_size=(k, 3))
        if k and not (0 <= self.leaf_stem.min() and self.leaf_stem.max() < m):
            raise ValueError(f"leaf_stem must be from 0 to {m - 1}")

    @property
    def num_stems(self) -> int:
        """Number of stems, elastic and fixed."""
        return len(self.p_WH)

    @property
    def fixed(self) -> BoolVector:
        """Which stems are fixed branches, shape (m,)."""
        return np.isinf(self.stiffness)

    def subset(self, which: BoolVector) -> "Stems":
        """Returns the stems in a mask of shape (m,), with their leaves."""
        leaves = which[self.leaf_stem]
        of_stems = ("p_WH", "R_WS", "length", "radius", "mass", "stiffness", "damping")
        of_leaves = ("p_SL", "R_SL", "leaf_size")
        return Stems(
            **{name: getattr(self, name)[which] for name in of_stems},
            **{name: getattr(self, name)[leaves] for name in of_leaves},
            leaf_stem=(np.cumsum(which) - 1)[self.leaf_stem[leaves]],
        )


@dataclass(frozen=True, kw_only=True)
class ClutterInstance:
    """The n objects of one environment, in W, SI units; see `make_objects` and `join`.

    Attributes:
        shape: n names in `SHAPES`.
        size: Shape (n, 3): the dimensions in `SHAPES`, then zeros.
        p_WO: Centres, shape (n, 3), metres.
        yaw: Rotations about Wz, shape (n,), radians.
        mass: Shape (n,), kg; ignored for fixed objects.
        movable: Shape (n,).
        material: Of each object, for its colour; may be empty.
        p_WG: The environment's goal, shape (3,), metres; None if goals are sampled elsewhere.
        p_WA: Centres of the open apertures, shape (k, 3), metres; None without a barrier.
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
        """Degrees of freedom of a movable object: 2 on the ground, 3 for floating spheres."""
        return 3 if "sphere" in self.shape else 2

    def translated(self, offset: Vector) -> "ClutterInstance":
        """Returns the environment translated by an offset, shape (3,), metres."""
        stems = self.stems and replace(self.stems, p_WH=self.stems.p_WH + offset)
        p_WG, p_WA = (p if p is None else p + offset for p in (self.p_WG, self.p_WA))
        return replace(self, p_WO=self.p_WO + offset, p_WG=p_WG, p_WA=p_WA, stems=stems)

    def subset(self, indices: IntVector) -> "ClutterInstance":
        """Returns the environment with the objects at these indices, which may repeat."""
        columns: dict[str, Any] = {name: getattr(self, name)[indices] for name in _ARRAYS}
        columns |= {name: tuple(getattr(self, name)[i] for i in indices) for name in _NAMES}
        return replace(self, **columns)

    def with_objects_at(self, p_WO: Vector) -> "ClutterInstance":
        """Returns the environment with its movable objects at p_WO, shape (k, num_axes)."""
        if self.stems is not None:  # They spring back when released.
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
    """Returns n objects of one shape; see `ClutterInstance`.

    Centres have shape (n, 3), or (n, 2) for z = 0. The shape's dimensions, yaw, mass and movable
    are those of all objects or of each.
    """
    p_WO = np.atleast_2d(np.asarray(p_WO, dtype=float))
    n = len(p_WO)
    return ClutterInstance(
        shape=(shape,) * n,
        size=_pad(np.atleast_2d(np.asarray(size, dtype=float)), n),
        p_WO=_pad(p_WO, n),
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
    parts = (make_objects("box", [1.0], np.empty((0, 3))), *parts)
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS
    }
    columns |= {name: sum((getattr(part, name) for part in parts), ()) for name in _NAMES}
    return ClutterInstance(**columns, p_WG=p_WG, p_WA=p_WA, stems=stems)


def _pad(rows: Vector, n: int) -> Vector:
    """Returns n rows padded with zeros to three columns."""
    padded = np.zeros((n, 3))
    padded[:, : rows.shape[1]] = rows
    return padded


def place_discs(
    rng: np.random.Generator, count: int, lower: ArrayLike, upper: ArrayLike, min_distance: float
) -> Vector:
    """Samples uniform centres, shape (count, d), metres, rejecting those too close to earlier ones.

    The rule of the authors' generator (gt-ros-pkg/hrl-haptic-manip, obstacles.py), which ignores
    goals. Discs, or balls, that do not fit between the corners are a ScenarioError.
    """
    lower, upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    centres = np.empty((count, len(lower)))
    for i in range(count):
        for _ in range(MAX_TRIES):
            candidate = rng.uniform(lower, upper)
            if np.all(np.sum((centres[:i] - candidate) ** 2, axis=1) >= min_distance**2):
                centres[i] = candidate
                break
        else:
            size = np.prod(upper - lower)
            raise ScenarioError(
                f"only {i} of {count} objects fit into {size:.3g} m^{len(lower)} at a distance of"
                f" {min_distance:.3g} m; use fewer or smaller objects or a larger region"
            )
    return centres
