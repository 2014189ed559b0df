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
        taxels = np.argmin(np.sum((patch.p_RQ[:, None] - p_RT) ** 2, axis=2), axis=1)
        span = np.ptp(p_RT[taxels], axis=0)
        if span @ span <= (1.5 * layout.pitch_m) ** 2:
            p_RC = magnitudes @ patch.p_RQ / total
            # Not the sum of the faces' magnitudes: the facets of a coarse contact mesh and the
            # sides of a corner splay their forces.
            f_R = patch.f_R.sum(axis=0)
            taxel = _nearest_facing(p_RT, layout.n_L[mine] @ R.T, p_RC, f_R)
            forces[mine[taxel]] += np.linalg.norm(f_R)
        else:
            np.add.at(forces, mine[taxels], magnitudes)
    return forces


def _nearest_facing(
    p_RT: NDArray[np.float64],
    n_R: NDArray[np.float64],
    p_RC: NDArray[np.float64],
    f_R: NDArray[np.float64],
) -> np.intp:
    """Returns the taxel nearest to the contact point C among those that face its force."""
    facing = n_R @ f_R >= MAX_ANGLE_COS * np.linalg.norm(f_R)
    if not np.any(facing):  # Then the nearest one takes it: no force is lost.
        facing[:] = True
    distance = np.sum((p_RC - p_RT) ** 2, axis=1)
    return np.argmin(np.where(facing, distance, np.inf))
