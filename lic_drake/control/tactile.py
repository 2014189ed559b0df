"""From contact patches to one normal force a taxel. No Drake here."""

import math
from typing import NamedTuple

import numpy as np

from lic_drake.control.taxels import LinkTaxels, TaxelLayout
from lic_drake.types import Vector

MAX_ANGLE_COS = np.cos(np.deg2rad(45.0))
"""A taxel takes a force only from within 45 degrees of its normal (authors' simulator)."""


class ContactPatch(NamedTuple):
    """One contact of a link with one object.

    Attributes:
        link: Index of the link.
        p_RQ: Centres of the patch's faces (one for a point contact), shape (k, 3), metres.
        n_R: Unit normals of the faces, out of the link, shape (k, 3).
        force: Normal forces of the link on the object at the faces, shape (k,), N.
    """

    link: int
    p_RQ: Vector
    n_R: Vector
    force: Vector


def calc_taxel_forces(
    layout: TaxelLayout,
    R_RL: Vector,
    p_RL: Vector,
    patches: list[ContactPatch],
) -> Vector:
    """Returns the normal force on each taxel, shape (num_taxels,), N, compression positive.

    A patch on one or two neighbouring taxels loads the single taxel at its centre of pressure, as
    one contact does in the authors' simulator, with the patch's resultant; a wider one loads the
    taxels under its faces. No force is lost.

    Args:
        layout: The taxels.
        R_RL: Rotations of the links, shape (k, 3, 3).
        p_RL: Positions of the links, shape (k, 3), metres.
        patches: The contacts.
    """
    forces = np.zeros(layout.num_taxels)
    for link, p_RQ, n_R, force in patches:
        total = force.sum()
        if total <= 0.0:
            continue
        mine, R = layout.of_link[link], R_RL[link]
        p_LQ = (p_RQ - p_RL[link]) @ R
        under = mine.compare_distances(p_LQ).argmin(axis=1)
        p_LT = mine.p_LT[under]
        span = p_LT.max(axis=0) - p_LT.min(axis=0)
        if span @ span <= (1.5 * layout.pitch_m) ** 2:
            # Not the sum of the faces' forces: the facets of a coarse contact mesh and the sides
            # of a corner splay them.
            f_L = force @ n_R @ R
            size = math.sqrt(f_L @ f_L)
            taxel = _nearest_facing(mine, force @ p_LQ / total, f_L)
            forces[mine.taxels[taxel]] += size
        else:
            np.add.at(forces, mine.taxels[under], force)
    return forces


def _nearest_facing(mine: LinkTaxels, p_LC: Vector, f_L: Vector) -> np.intp:
    """Returns the taxel nearest to the contact point C among those that face its force."""
    facing = mine.n_L @ f_L >= MAX_ANGLE_COS * math.sqrt(f_L @ f_L)
    distance = mine.compare_distances(p_LC)
    # Where none faces it the nearest one takes it: no force is lost.
    return np.argmin(np.where(facing, distance, np.inf) if facing.any() else distance)
