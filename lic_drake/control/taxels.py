"""Placement of taxels on the arm's surface, in the plane and in space."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lic_drake.robots.arm import Arm, SkinShape
from lic_drake.types import BoolVector, IntVector, Vector

CAP_ANGLES_DEG = (-72.0, -36.0, 0.0, 36.0, 72.0)
"""Angles of the taxels on an end cap from the capsule's axis (authors' simulator)."""
INSIDE_M = 1e-6
"""Minimum depth inside another shape of the link at which a taxel is removed."""


class LinkTaxels(NamedTuple):
    """The taxels of one link, in its frame: their indices in the layout, and |p_LT|^2 / 2."""

    taxels: IntVector
    p_LT: Vector
    n_L: Vector
    half_square: Vector

    def compare_distances(self, p_LQ: Vector) -> Vector:
        """Returns |p_QT|^2 / 2 - |p_LQ|^2 / 2, which orders taxels by distance from p_LQ."""
        return self.half_square - p_LQ @ self.p_LT.T


@dataclass(frozen=True)
class TaxelLayout:
    """n taxels of an arm.

    Attributes:
        pitch_m: Distance between neighbours in a row, metres.
        link: Index of each taxel's link, shape (n,).
        p_LT: Positions in the link frames, shape (n, 3), metres.
        n_L: Outward unit normals, shape (n, 3).
    """

    pitch_m: float
    link: IntVector
    p_LT: Vector
    n_L: Vector

    @property
    def num_taxels(self) -> int:
        """Number of taxels on the whole arm."""
        return len(self.link)

    @cached_property
    def of_link(self) -> tuple[LinkTaxels, ...]:
        """The taxels of each link."""
        half_square = 0.5 * np.sum(self.p_LT**2, axis=1)
        of_links = (np.flatnonzero(self.link == link) for link in range(self.link.max() + 1))
        return tuple(LinkTaxels(k, self.p_LT[k], self.n_L[k], half_square[k]) for k in of_links)


def make_taxels(arm: Arm, per_metre: float) -> TaxelLayout:
    """Returns the taxels of an arm: rows around capsules in the plane, else on all its faces.

    Their density, 1/m, is 100 in the plane in paper V-A.
    """
    if arm.is_planar:
        return planar_taxels(arm.skin, arm.link_names, per_metre)
    return surface_taxels(arm.skin, arm.link_names, per_metre)


def planar_taxels(
    skin: tuple[SkinShape, ...], link_names: tuple[str, ...], per_metre: float = 100.0
) -> TaxelLayout:
    """Returns taxels around each link's capsule in the plane of motion, z = 0.

    Rows on both long sides, symmetric about the link's centre, and five taxels on each end cap, as
    in the authors' simulator.
    """
    links, positions, normals = [], [], []
    cap = np.deg2rad(CAP_ANGLES_DEG)
    for capsule in skin:
        link = link_names.index(capsule.link)
        radius, length = capsule.size
        along = capsule.R_LS[:, 2]
        side = np.cross([0.0, 0.0, 1.0], along)
        count = int(np.floor(length * per_metre + 1e-9))
        offsets = (np.arange(count) - 0.5 * (count - 1)) / per_metre
        rows = [(offset * along, sign * side) for sign in (1.0, -1.0) for offset in offsets]
        for end in (1.0, -1.0):
            centre = end * 0.5 * length * along
            rows += [(centre, np.cos(a) * end * along + np.sin(a) * side) for a in cap]
        links += [link] * len(rows)
        positions += [capsule.p_LS + centre + radius * normal for centre, normal in rows]
        normals += [normal for _, normal in rows]
    return TaxelLayout(1.0 / per_metre, np.array(links), np.array(positions), np.array(normals))


def surface_taxels(
    surface: tuple[SkinShape, ...], link_names: tuple[str, ...], per_metre: float
) -> TaxelLayout:
    """Returns a lattice of taxels on every face, except inside another shape of the link.

    Rows are equally spaced, with half of that distance to the face's edges, so that all taxels
    represent equal areas.
    """
    links, positions, normals = [], [], []
    for shape in surface:
        p_ST, n_S = _LATTICE[shape.kind](shape, per_metre)
        p_LT = shape.p_LS + p_ST @ shape.R_LS.T
        others = [s for s in surface if s.link == shape.link and s is not shape]
        free = ~np.any([np.zeros(len(p_LT)), *(is_inside(s, p_LT) for s in others)], axis=0)
        links.append(np.full(np.count_nonzero(free), link_names.index(shape.link)))
        positions.append(p_LT[free])
        normals.append((n_S @ shape.R_LS.T)[free])
    return TaxelLayout(
        1.0 / per_metre, np.concatenate(links), np.vstack(positions), np.vstack(normals)
    )


def is_inside(shape: SkinShape, p_LQ: Vector) -> BoolVector:
    """Returns which points of the link's frame, shape (n, 3), lie inside a shape."""
    p_SQ = np.abs((p_LQ - shape.p_LS) @ shape.R_LS)
    if shape.kind == "box":
        return np.all(p_SQ < 0.5 * np.array(shape.size) - INSIDE_M, axis=1)
    radius, length = shape.size
    beyond = p_SQ[:, 2] - 0.5 * length
    across = np.hypot(p_SQ[:, 0], p_SQ[:, 1])
    if shape.kind == "capsule":
        return np.hypot(across, np.maximum(beyond, 0.0)) < radius - INSIDE_M
    return (across < radius - INSIDE_M) & (beyond < -INSIDE_M)


def _box(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on the six faces, in S."""
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        across, along = (_rows(shape.size[i], per_metre) for i in (u, v))
        rows = np.array([(a, b) for a in across for b in along])
        for sign in (1.0, -1.0):
            n = np.tile(sign * np.eye(3)[axis], (len(rows), 1))
            p = 0.5 * shape.size[axis] * n
            p[:, [u, v]] = rows
            faces.append((p, n))
    positions, normals = zip(*faces, strict=True)
    return np.vstack(positions), np.vstack(normals)


def _cylinder(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on barrel and ends, in S."""
    radius, length = shape.size
    around = _ring(radius, per_metre)
    barrel = np.array([(c, s, z) for z in _rows(length, per_metre) for c, s in around])
    positions, normals = [barrel * [radius, radius, 1.0]], [barrel * [1.0, 1.0, 0.0]]
    # Rings in the middle of equally wide strips of the end faces.
    strips = max(1, round(radius * per_metre))
    radii = radius * (np.arange(strips) + 0.5) / strips
    disc = np.vstack([r * _ring(r, per_metre) for r in radii])
    for sign in (1.0, -1.0):
        end = np.column_stack([disc, np.full(len(disc), 0.5 * sign * length)])
        positions.append(end)
        normals.append(np.tile([0.0, 0.0, sign], (len(end), 1)))
    return np.vstack(positions), np.vstack(normals)


def _capsule(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on barrel and hemispheres, in S."""
    radius, length = shape.size
    n_S = [(c, s, 0.0) for _ in _rows(length, per_metre) for c, s in _ring(radius, per_metre)]
    z = [z for z in _rows(length, per_metre) for _ in _ring(radius, per_metre)]
    # Rings in the middle of equally wide strips of the hemispheres, and a taxel at the poles: where
    # a thin arm presses with its end, the controller has to know the true direction.
    strips = max(1, round(0.5 * np.pi * radius * per_metre - 0.5))
    n_S += [(0.0, 0.0, sign) for sign in (1.0, -1.0)]
    z += [sign * 0.5 * length for sign in (1.0, -1.0)]
    for elevation in 0.5 * np.pi * (np.arange(strips) + 0.5) / (strips + 0.5):
        up, across = np.sin(elevation), np.cos(elevation)
        for sign in (1.0, -1.0):
            ring = _ring(radius * across, per_metre)
            n_S += [(across * c, across * s, sign * up) for c, s in ring]
            z += [sign * 0.5 * length] * len(ring)
    normals = np.array(n_S)
    return radius * normals + np.outer(z, [0.0, 0.0, 1.0]), normals


def _rows(length: float, per_metre: float) -> Vector:
    """Returns the positions of rows over a length centred at 0, shape (n,), metres."""
    count = max(1, round(length * per_metre))
    return np.asarray((np.arange(count) + 0.5) * (length / count) - 0.5 * length)


def _ring(radius: float, per_metre: float) -> Vector:
    """Returns unit vectors to the taxels of a ring, shape (n, 2)."""
    count = max(3, round(2.0 * np.pi * radius * per_metre))
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([np.cos(angle), np.sin(angle)])


_LATTICE = {"box": _box, "cylinder": _cylinder, "capsule": _capsule}
