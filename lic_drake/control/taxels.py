"""Where the taxels are on the arm's surface."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.robots.arm import SkinCapsule

CAP_ANGLES_DEG = (-72.0, -36.0, 0.0, 36.0, 72.0)
"""Directions of the taxels on an end cap, from the capsule's axis (authors' simulator)."""


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
    p_LT: NDArray[np.float64]
    n_L: NDArray[np.float64]

    @property
    def num_taxels(self) -> int:
        """Number of taxels on the whole arm."""
        return len(self.link)


def planar_taxels(skin: tuple[SkinCapsule, ...], per_metre: float = 100.0) -> TaxelLayout:
    """Returns taxels around each capsule in the plane of motion (z = 0).

    Rows on both long sides, symmetric about the link's centre, and five taxels on each end cap,
    as in the authors' simulator; 100 a metre is the paper's density (V-A).

    Args:
        skin: One capsule a link, axes in the plane.
        per_metre: Density of the rows, 1/m.
    """
    links, positions, normals = [], [], []
    for index, capsule in enumerate(skin):
        along = capsule.R_LC[:, 2]
        side = np.cross([0.0, 0.0, 1.0], along)
        count = int(np.floor(capsule.length * per_metre + 1e-9))
        offsets = (np.arange(count) - 0.5 * (count - 1)) / per_metre
        rows = [(offset * along, sign * side) for sign in (1.0, -1.0) for offset in offsets]
        cap = np.deg2rad(CAP_ANGLES_DEG)
        for end in (1.0, -1.0):
            centre = end * 0.5 * capsule.length * along
            rows += [(centre, np.cos(a) * end * along + np.sin(a) * side) for a in cap]
        for centre, normal in rows:
            links.append(index)
            positions.append(capsule.p_LC + centre + capsule.radius * normal)
            normals.append(normal)
    return TaxelLayout(
        pitch_m=1.0 / per_metre,
        link=np.array(links),
        p_LT=np.array(positions),
        n_L=np.array(normals),
    )
