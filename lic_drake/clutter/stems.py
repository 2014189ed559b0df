"""`Stems`: elastic stems with leaves, as plain arrays."""

from dataclasses import dataclass, replace

import numpy as np

from lic_drake.types import BoolVector, IntVector, Vector, check_shapes


@dataclass(frozen=True, kw_only=True)
class Stems:
    """m straight stems that bend at their roots, and the k leaves on them, in W, SI units.

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
    leaf_stem: IntVector
    p_SL: Vector
    R_SL: Vector
    leaf_size: Vector

    def __post_init__(self) -> None:
        m, k = len(self.p_WH), len(self.leaf_stem)
        check_shapes(self, p_WH=(m, 3), R_WS=(m, 3, 3), length=(m,), radius=(m,), mass=(m,))
        check_shapes(self, stiffness=(m,), damping=(m,))
        check_shapes(self, p_SL=(k, 3), R_SL=(k, 3, 3), leaf_size=(k, 3))
        if k and not (0 <= self.leaf_stem.min() and self.leaf_stem.max() < m):
            raise ValueError(f"leaf_stem must be from 0 to {m - 1}")

    @property
    def num_stems(self) -> int:
        """Number of stems, springy and fixed."""
        return len(self.p_WH)

    @property
    def fixed(self) -> BoolVector:
        """Which stems cannot bend, shape (m,)."""
        return np.isinf(self.stiffness)

    def translated(self, offset: Vector) -> "Stems":
        """Returns the same stems moved by an offset, shape (3,), metres."""
        return replace(self, p_WH=self.p_WH + offset)

    def subset(self, which: BoolVector) -> "Stems":
        """Returns some of the stems with their leaves, by a mask of shape (m,)."""
        leaves = which[self.leaf_stem]
        of_stems = ("p_WH", "R_WS", "length", "radius", "mass", "stiffness", "damping")
        of_leaves = ("p_SL", "R_SL", "leaf_size")
        return Stems(
            **{name: getattr(self, name)[which] for name in of_stems},
            **{name: getattr(self, name)[leaves] for name in of_leaves},
            leaf_stem=(np.cumsum(which) - 1)[self.leaf_stem[leaves]],
        )
