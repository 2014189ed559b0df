"""From contact patches to one normal force a taxel. No Drake here."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.control.taxels import TaxelLayout

MAX_ANGLE_COS = np.cos(np.deg2rad(45.0))
"""A taxel takes a force only from within 45 degrees of its normal (authors' simulator)."""


@dataclass(frozen=True, kw_only=True)
class ContactPatch:
    """One contact of a link with one object.

    Attributes:
        link: Index of the link.
        p_RQ: Centres of the patch's faces (one for a point contact), shape (k, 3), metres.
        f_R: Normal forces of the link on the object at the faces, shape (k, 3), N.
    """

    link: int
    p_RQ: NDArray[np.float64]
    f_R: NDArray[np.float64]


def calc_taxel_forces(
    layout: TaxelLayout,
    R_RL: NDArray[np.float64],
    p_RL: NDArray[np.float64],
    patches: list[ContactPatch],
) -> NDArray[np.float64]:
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
    for patch in patches:
        magnitudes = np.linalg.norm(patch.f_R, axis=1)
        total = magnitudes.sum()
        if total <= 0.0:
            continue
        mine = np.flatnonzero(layout.link == patch.link)
        R, p = R_RL[patch.link], p_RL[patch.link]
        p_RT = p + layout.p_LT[mine] @ R.T
        n_R = layout.n_L[mine] @ R.T
        taxels = _nearest(p_RT, n_R, patch.p_RQ, patch.f_R)
        span = np.ptp(p_RT[taxels], axis=0)
        if span @ span <= (1.5 * layout.pitch_m) ** 2:
            p_RC = magnitudes @ patch.p_RQ / total
            f_R = patch.f_R.sum(axis=0, keepdims=True)
            taxels = _nearest(p_RT, n_R, p_RC[None], f_R)
            # Not the sum of the faces' magnitudes: the facets of a coarse contact mesh splay
            # their forces, which would read up to 11 % too much.
            magnitudes = np.linalg.norm(f_R, axis=1)
        np.add.at(forces, mine[taxels], magnitudes)
    return forces


def _nearest(
    p_RT: NDArray[np.float64],
    n_R: NDArray[np.float64],
    p_RQ: NDArray[np.float64],
    f_R: NDArray[np.float64],
) -> NDArray[np.intp]:
    """Returns for each point Q the nearest taxel among those that face its force, shape (k,)."""
    distance = np.sum((p_RQ[:, None] - p_RT) ** 2, axis=2)
    facing = f_R @ n_R.T >= MAX_ANGLE_COS * np.linalg.norm(f_R, axis=1, keepdims=True)
    # Where no taxel faces the force, the nearest one takes it: no force is lost.
    facing |= ~np.any(facing, axis=1, keepdims=True)
    return np.argmin(np.where(facing, distance, np.inf), axis=1)
