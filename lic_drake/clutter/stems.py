"""`Stems`: elastic stems with leaves, as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Stems:
    """Straight stems that bend at their roots, and the leaves on them, in W, SI units.

    A stem is a rigid cylinder on a springy hinge at its root H. Its frame S lies at the root, Sz
    along the stem; with the spring at rest R_WS is as given here.

    Attributes:
        p_WH: Roots, shape (m, 3), metres.
        R_WS: Orientations at rest, shape (m, 3, 3).
        length: Shape (m,), metres.
        radius: Shape (m,), metres.
        mass: Of a stem with its leaves, shape (m,), kg.
        stiffness: Of the hinge about any axis across the stem, shape (m,), Nm/rad; infinite for a
            branch that is fixed.
        damping: Of the hinge, shape (m,), Nms/rad.
        leaf_stem: Index of the stem that carries each leaf, shape (k,).
        p_SL: Centres of the leaves in their stem's frame, shape (k, 3), metres.
        R_SL: Their orientations, shape (k, 3, 3); Lx along the leaf, Lz across it.
        leaf_size: Full edges of the leaves along Lx, Ly and Lz, shape (k, 3), metres.
    """

    p_WH: Vector
    R_WS: Vector
    length: Vector
    radius: Vector
    mass: Vector
    stiffness: Vector
    damping: Vector
    leaf_stem: NDArray[np.intp]
    p_SL: Vector
    R_SL: Vector
    leaf_size: Vector

    def __post_init__(self) -> None:
        m, k = len(self.p_WH), len(self.leaf_stem)
        for name, expected in (
            ("p_WH", (m, 3)),
            ("R_WS", (m, 3, 3)),
            *((name, (m,)) for name in ("length", "radius", "mass", "stiffness", "damping")),
            ("leaf_stem", (k,)),
            ("p_SL", (k, 3)),
            ("R_SL", (k, 3, 3)),
            ("leaf_size", (k, 3)),
        ):
            value = getattr(self, name)
            if value.shape != expected:
                raise ValueError(f"{name} has shape {value.shape}, expected {expected}")
        if k and not (0 <= self.leaf_stem.min() and self.leaf_stem.max() < m):
            raise ValueError(f"leaf_stem must be from 0 to {m - 1}")

    @property
    def num_stems(self) -> int:
        """Number of stems, springy and fixed."""
        return len(self.p_WH)

    @property
    def fixed(self) -> NDArray[np.bool_]:
        """Which stems cannot bend, shape (m,)."""
        fixed: NDArray[np.bool_] = np.isinf(self.stiffness)
        return fixed

    def translated(self, offset: Vector) -> "Stems":
        """Returns the same stems moved by an offset, shape (3,), metres."""
        return replace(self, p_WH=self.p_WH + offset)

    def picked(self, which: NDArray[np.bool_]) -> "Stems":
        """Returns some of the stems with their leaves, by a mask of shape (m,)."""
        leaves = which[self.leaf_stem]
        return Stems(
            p_WH=self.p_WH[which],
            R_WS=self.R_WS[which],
            length=self.length[which],
            radius=self.radius[which],
            mass=self.mass[which],
            stiffness=self.stiffness[which],
            damping=self.damping[which],
            leaf_stem=(np.cumsum(which) - 1)[self.leaf_stem[leaves]],
            p_SL=self.p_SL[leaves],
            R_SL=self.R_SL[leaves],
            leaf_size=self.leaf_size[leaves],
        )
