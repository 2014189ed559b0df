"""Where the taxels are on the arm's surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.robots.skin import SkinShape
from lic_drake.types import Vector

CAP_ANGLES_DEG = (-72.0, -36.0, 0.0, 36.0, 72.0)
"""Directions of the taxels on an end cap, from the capsule's axis (authors' simulator)."""


class LinkTaxels(NamedTuple):
    """The taxels of one link, in its frame.

    Attributes:
        taxels: Their indices among those of the whole arm, shape (n,).
        p_LT: Positions, shape (n, 3), metres.
        n_L: Outward unit normals, shape (n, 3).
        half_square: Half of each position's squared length, shape (n,), square metres.
    """

    taxels: NDArray[np.intp]
    p_LT: Vector
    n_L: Vector
    half_square: Vector

    def compare_distances(self, p_LQ: Vector) -> Vector:
        """Returns what grows with the distance from Q to each taxel, shape (.., n).

        That is 1/2 |p_QT|^2 without the 1/2 |p_LQ|^2 that all taxels have in common.

        Args:
            p_LQ: One point or many, shape (.., 3), metres.
        """
        return self.half_square - p_LQ @ self.p_LT.T


@dataclass(frozen=True, kw_only=True)
class TaxelLayout:
    """Taxels of an arm.

    Attributes:
        pitch_m: Distance between two taxels of a row, metres.
        link: Index of the link that carries each taxel, shape (n,).
        p_LT: Positions in the link frames, shape (n, 3), metres.
        n_L: Outward unit normals in the link frames, shape (n, 3).
    """

    pitch_m: float
    link: NDArray[np.intp]
    p_LT: Vector
    n_L: Vector

    @property
    def num_taxels(self) -> int:
        """Number of taxels on the whole arm."""
        return len(self.link)

    @cached_property
    def of_link(self) -> tuple[LinkTaxels, ...]:
        """The taxels link by link, as the sensor needs them at every control step."""
        links = []
        for link in range(self.link.max() + 1):
            taxels = np.flatnonzero(self.link == link)
            p_LT = self.p_LT[taxels]
            half_square = 0.5 * np.sum(p_LT**2, axis=1)
            links.append(LinkTaxels(taxels, p_LT, self.n_L[taxels], half_square))
        return tuple(links)


def planar_taxels(skin: tuple[SkinShape, ...], per_metre: float = 100.0) -> TaxelLayout:
    """Returns taxels around each capsule in the plane of motion (z = 0).

    Rows on both long sides, symmetric about the link's centre, and five taxels on each end cap,
    as in the authors' simulator; 100 a metre is the paper's density (V-A).

    Args:
        skin: One capsule a link, axes in the plane.
        per_metre: Density of the rows, 1/m.
    """
    links, positions, normals = [], [], []
    for index, capsule in enumerate(skin):
        radius, length = capsule.size
        along = capsule.R_LS[:, 2]
        side = np.cross([0.0, 0.0, 1.0], along)
        count = int(np.floor(length * per_metre + 1e-9))
        offsets = (np.arange(count) - 0.5 * (count - 1)) / per_metre
        rows = [(offset * along, sign * side) for sign in (1.0, -1.0) for offset in offsets]
        cap = np.deg2rad(CAP_ANGLES_DEG)
        for end in (1.0, -1.0):
            centre = end * 0.5 * length * along
            rows += [(centre, np.cos(a) * end * along + np.sin(a) * side) for a in cap]
        for centre, normal in rows:
            links.append(index)
            positions.append(capsule.p_LS + centre + radius * normal)
            normals.append(normal)
    return TaxelLayout(
        pitch_m=1.0 / per_metre,
        link=np.array(links),
        p_LT=np.array(positions),
        n_L=np.array(normals),
    )
