"""`TactileSensor`: the tactile skin as a Drake system."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, cast

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from lic_drake.control.taxels import TaxelLayout
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

BODY = -1
"""Link index of the robot's geometry without skin."""
# A taxel only senses forces within 45 degrees of its normal (authors' simulator).
_MAX_ANGLE_COS = np.cos(np.deg2rad(45.0))


class ContactPatch(NamedTuple):
    """A contact of a link with an object; k faces, one for a point contact.

    Centres of the faces, shape (k, 3), unit normals out of the link, and normal forces, shape (k,).
    """

    link: int
    p_RQ: Vector
    n_R: Vector
    force: Vector


class TactileSensor(LeafSystem):
    """Computes the normal force on each taxel from contact results.

    Hydroelastic patches are read face by face (pressure times area); point contacts, Drake's silent
    fallback for two rigid bodies, count as patches of one face.

    Input ports:
        contact_results: Contact results of the plant (abstract).
        arm_state: [q, v] of the arm, size 2 m, rad and rad/s.
    Output port:
        taxel_force: Normal force on each taxel, size num_taxels, N, compression positive.

    Args:
        skin_links: Skin geometry -> index into the arm's link names.
        body: Geometry of the rest of the robot; contact with oneself is not sensed.
    """

    def __init__(
        self,
        arm: Arm,
        layout: TaxelLayout,
        skin_links: dict[GeometryId, int],
        body: Iterable[GeometryId] = (),
    ) -> None:
        super().__init__()
        self._arm, self._layout = arm, layout
        # Integers: a GeometryId returned by a plant keeps the whole diagram alive.
        self._skin_links = {geometry.get_value(): link for geometry, link in skin_links.items()}
        self._skin_links |= {geometry.get_value(): BODY for geometry in body}
        self._contact_results = self.DeclareAbstractInputPort(
            "contact_results", Value(ContactResults())
        )
        self._arm_state = self.DeclareVectorInputPort("arm_state", 2 * arm.num_joints)
        self.DeclareVectorOutputPort(
            "taxel_force",
            layout.num_taxels,
            self._calc_taxel_force,
            # Time is left out, so that all readers at an instant share one calculation.
            prerequisites_of_calc={
                self.input_port_ticket(self._contact_results.get_index()),
                self.input_port_ticket(self._arm_state.get_index()),
            },
        )

    def _calc_taxel_force(self, context: Context, output: BasicVector) -> None:
        results = cast(ContactResults, self._contact_results.Eval(context))
        patches = read_patches(results, lambda geometry: self._skin_links.get(geometry.get_value()))
        if not patches:
            output.SetZero()
            return
        q = np.asarray(self._arm_state.Eval(context))[: self._arm.num_joints]
        pose = self._arm.calc_pose(q)
        output.SetFromVector(calc_taxel_forces(self._layout, pose.R_RL, pose.p_RL, patches))


def read_patches(
    results: ContactResults, link_of: Callable[[GeometryId], int | None]
) -> list[ContactPatch]:
    """Returns the contacts between the arm's skin and other bodies.

    `link_of` returns the link index of a skin geometry, `BODY` for the rest of the robot, and None
    for any other geometry.
    """
    patches = []
    for k in range(results.num_hydroelastic_contacts()):
        # The normals of a surface's faces point out of N, into M.
        surface = results.hydroelastic_contact_info(k).contact_surface()
        link, sign = _felt(link_of(surface.id_N()), link_of(surface.id_M()))
        if link != BODY:
            pressure, faces = surface.poly_e_MN(), range(surface.num_faces())
            p_WQ = [surface.centroid(i) for i in faces]
            normal = np.array([surface.face_normal(i) for i in faces])
            force = [pressure.EvaluateCartesian(i, p_WQ[i]) * surface.area(i) for i in faces]
            patches.append(ContactPatch(link, np.array(p_WQ), sign * normal, np.array(force)))
    for k in range(results.num_point_pair_contacts()):
        info = results.point_pair_contact_info(k)
        pair = info.point_pair()
        link, sign = _felt(link_of(pair.id_A), link_of(pair.id_B))
        if link != BODY:
            n_R = -sign * np.asarray(pair.nhat_BA_W)
            # Drake reports the force on body B.
            size = max(0.0, float(sign * n_R @ info.contact_force()))
            p_RQ = np.asarray(info.contact_point())
            patches.append(ContactPatch(link, p_RQ[None], n_R[None], np.array([size])))
    return patches


def _felt(first: int | None, second: int | None) -> tuple[int, float]:
    """Returns the link in contact, else `BODY`, and 1 or -1 if it is the first or second one."""
    if first is None and second is not None:
        return second, -1.0
    if second is None and first is not None:
        return first, 1.0
    return BODY, 0.0


def calc_taxel_forces(
    layout: TaxelLayout, R_RL: Vector, p_RL: Vector, patches: list[ContactPatch]
) -> Vector:
    """Returns the normal force on each taxel, shape (num_taxels,), N, compression positive.

    The resultant of a patch over one or two neighbouring taxels acts on the taxel at its centre of
    pressure that faces it, as a contact does in the authors' simulator; a wider patch loads the
    taxels under its faces. No force is lost.
    """
    forces = np.zeros(layout.num_taxels)
    for link, p_RQ, n_R, force in patches:
        total = force.sum()
        if total <= 0.0:
            continue
        mine, R = layout.of_link[link], R_RL[link]
        p_LQ = (p_RQ - p_RL[link]) @ R
        extent = p_LQ.max(axis=0) - p_LQ.min(axis=0)
        # What is no wider than the distance of two taxels lies over neighbours in any case.
        if extent @ extent > layout.pitch_m**2:
            under = mine.compare_distances(p_LQ).argmin(axis=1)
            p_LT = mine.p_LT[under]
            extent = p_LT.max(axis=0) - p_LT.min(axis=0)
            if extent @ extent > (1.5 * layout.pitch_m) ** 2:
                np.add.at(forces, mine.taxels[under], force)
                continue
        # Not the sum of the magnitudes: facets of a coarse mesh and corners spread directions.
        f_L = force @ n_R @ R
        size = math.sqrt(f_L @ f_L)
        distance = mine.compare_distances(force @ p_LQ / total)
        (facing,) = (mine.n_L @ f_L >= _MAX_ANGLE_COS * size).nonzero()
        if len(facing):
            nearest = facing[distance[facing].argmin()]
        else:
            nearest = distance.argmin()
        forces[mine.taxels[nearest]] += size
    return forces
