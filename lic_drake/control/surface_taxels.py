"""Taxels on the surfaces of boxes, cylinders and capsules: the skin of an arm in space."""

import numpy as np
from numpy.typing import NDArray

from lic_drake.control.taxels import TaxelLayout, planar_taxels
from lic_drake.robots.arm import Arm
from lic_drake.robots.skin import SkinShape
from lic_drake.types import Vector

INSIDE_M = 1e-6
"""A taxel this deep inside another shape of its link is covered by it."""


def make_taxels(arm: Arm, per_metre: float) -> TaxelLayout:
    """Returns the taxels of an arm: rows around capsules in the plane, else all over its faces.

    Args:
        arm: The arm.
        per_metre: Density of the rows, 1/m (paper V-A: 100 in the plane).
    """
    if arm.is_planar:
        return planar_taxels(arm.skin, per_metre)
    return surface_taxels(arm.skin, arm.link_names, per_metre)


def surface_taxels(
    surface: tuple[SkinShape, ...], link_names: tuple[str, ...], per_metre: float
) -> TaxelLayout:
    """Returns a lattice of taxels on every face, but for points inside another shape of the link.

    A face gets as many rows as fit at the density, and at least one, with equal distances between
    them and half of that to its edges, so that every taxel stands for an area of the same size.

    Args:
        surface: The shapes.
        link_names: Names of the links; a taxel's link is the index of its shape's in these.
        per_metre: Density of the rows, 1/m.
    """
    links, positions, normals = [], [], []
    for shape in surface:
        p_ST, n_S = _LATTICE[shape.kind](shape, per_metre)
        p_LT = shape.p_LS + p_ST @ shape.R_LS.T
        free = np.ones(len(p_LT), dtype=bool)
        for other in surface:
            if other.link == shape.link and other is not shape:
                free &= ~is_inside(other, p_LT)
        links.append(np.full(np.count_nonzero(free), link_names.index(shape.link)))
        positions.append(p_LT[free])
        normals.append((n_S @ shape.R_LS.T)[free])
    return TaxelLayout(
        pitch_m=1.0 / per_metre,
        link=np.concatenate(links),
        p_LT=np.vstack(positions),
        n_L=np.vstack(normals),
    )


def is_inside(shape: SkinShape, p_LQ: Vector) -> NDArray[np.bool_]:
    """Tells which points, shape (n, 3), in the frame of its link, lie within a shape."""
    p_SQ = np.abs((p_LQ - shape.p_LS) @ shape.R_LS)
    if shape.kind == "box":
        return np.all(p_SQ < 0.5 * np.array(shape.size) - INSIDE_M, axis=1)
    radius, length = shape.size
    if shape.kind == "capsule":
        p_SQ[:, 2] = np.maximum(p_SQ[:, 2] - 0.5 * length, 0.0)
        near: NDArray[np.bool_] = np.linalg.norm(p_SQ, axis=1) < radius - INSIDE_M
        return near
    inside: NDArray[np.bool_] = np.hypot(p_SQ[:, 0], p_SQ[:, 1]) < radius - INSIDE_M
    return inside & (p_SQ[:, 2] < 0.5 * length - INSIDE_M)


def _box(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on the six faces, in the shape's frame."""
    positions, normals = [], []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        rows = np.array(
            [
                (a, b)
                for a in _rows(shape.size[u], per_metre)
                for b in _rows(shape.size[v], per_metre)
            ]
        )
        for sign in (1.0, -1.0):
            p, n = np.zeros((len(rows), 3)), np.zeros((len(rows), 3))
            p[:, axis], n[:, axis] = 0.5 * sign * shape.size[axis], sign
            p[:, [u, v]] = rows
            positions.append(p)
            normals.append(n)
    return np.vstack(positions), np.vstack(normals)


def _cylinder(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on barrel and ends, in the shape's frame."""
    radius, length = shape.size
    around = _ring(radius, per_metre)
    barrel = np.array([(c, s, z) for z in _rows(length, per_metre) for c, s in around])
    positions, normals = [barrel * [radius, radius, 1.0]], [barrel * [1.0, 1.0, 0.0]]
    # Rings at the middles of equally wide strips of the end faces.
    strips = max(1, round(radius * per_metre))
    radii = radius * (np.arange(strips) + 0.5) / strips
    disc = np.vstack([r * _ring(r, per_metre) for r in radii])
    for sign in (1.0, -1.0):
        end = np.column_stack([disc, np.full(len(disc), 0.5 * sign * length)])
        positions.append(end)
        normals.append(np.tile([0.0, 0.0, sign], (len(end), 1)))
    return np.vstack(positions), np.vstack(normals)


def _capsule(shape: SkinShape, per_metre: float) -> tuple[Vector, Vector]:
    """Returns positions and normals on barrel and half spheres, in the shape's frame."""
    radius, length = shape.size
    n_S = [(c, s, 0.0) for _ in _rows(length, per_metre) for c, s in _ring(radius, per_metre)]
    z = [z for z in _rows(length, per_metre) for _ in _ring(radius, per_metre)]
    # Rings at the middles of equally high strips of the half spheres.
    strips = max(1, round(0.5 * np.pi * radius * per_metre))
    for up in (np.arange(strips) + 0.5) / strips:
        across = np.sqrt(1.0 - up**2)
        for sign in (1.0, -1.0):
            ring = _ring(radius * across, per_metre)
            n_S += [(across * c, across * s, sign * up) for c, s in ring]
            z += [sign * 0.5 * length] * len(ring)
    normals = np.array(n_S)
    return radius * normals + np.outer(z, [0.0, 0.0, 1.0]), normals


def _rows(length: float, per_metre: float) -> Vector:
    """Returns the places of rows over a length about 0, shape (n,), metres."""
    count = max(1, round(length * per_metre))
    return np.asarray((np.arange(count) + 0.5) * (length / count) - 0.5 * length)


def _ring(radius: float, per_metre: float) -> Vector:
    """Returns unit vectors to the taxels of a ring, shape (n, 2)."""
    angle = (
        2.0 * np.pi * np.arange(count := max(3, round(2.0 * np.pi * radius * per_metre))) / count
    )
    return np.column_stack([np.cos(angle), np.sin(angle)])


_LATTICE = {"box": _box, "cylinder": _cylinder, "capsule": _capsule}
