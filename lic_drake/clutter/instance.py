"""`ClutterInstance`: one drawn environment as plain arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """

    category: str
    shape: tuple[str, ...]
    size: NDArray[np.float64]
    p_WO: NDArray[np.float64]
    yaw: NDArray[np.float64]
    mass: NDArray[np.float64]
    movable: NDArray[np.bool_]
    p_WG: NDArray[np.float64] | None = None

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
        unknown = set(self.shape) - set(SHAPES)
        if unknown:
            raise ValueError(f"unknown shapes {sorted(unknown)}; known: {SHAPES}")

    @property
    def num_objects(self) -> int:
        """Number of objects, fixed and movable."""
        return len(self.shape)
