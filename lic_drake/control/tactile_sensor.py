"""`TactileSensor`: the tactile skin as a Drake system."""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, cast

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import GeometryId
from pydrake.multibody.plant import ContactResults, HydroelasticContactInfo, PointPairContactInfo
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from lic_drake.control.taxels import LinkTaxels, TaxelLayout
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

BODY = -1
"""Link index of the robot's geometry without skin."""

MAX_ANGLE_COS = np.cos(np.deg2rad(45.0))
"""A taxel only senses forces within 45 degrees of its normal (authors' simulator)."""


class ContactPatch(NamedTuple):
    """A contact of a link with an object; k faces, one for a point contact.

    Attributes:
        link: Index of the link.
        p_RQ: Centres of the faces, shape (k, 3), metres.
        n_R: Unit normals of the faces, out of the link, shape (k, 3).
        force: Normal forces of the link on the object, shape (k,), N.
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
        arm: The arm.
        layout: Its taxels.
        skin_links: Skin geometry -> index into the arm's link names.
        body: Geometry of the rest of the robot. Contact with it, or of the arm with itself, is not
            sensed: the controller would treat it as an obstacle.
    """

    def __init__(
        self,
        arm: Arm,
        layout: TaxelLayout,
        skin_links: dict[GeometryId, int],
        body: Iterable[GeometryId] = (),
    ) -> None:
        super().__init__()
        self._arm = arm
        self._num_joints = arm.num_joints
        self._layout = layout
        # Integers: a GeometryId returned by a plant keeps the whole diagram alive.
        self._skin_links = {geometry.get_value(): link for geometry, link in skin_links.items()}
        self._skin_links |= {geometry.get_value(): BODY for geometry in body}
        self._contact_results = self.DeclareAbstractInputPort(
            "contact_results", Value(ContactResults())
        )
        self._arm_state = self.DeclareVectorInputPort("arm_state", 2 * self._num_joints)
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
            output.SetFromVector(np.zeros(self._layout.num_taxels))
            return
        q = np.asarray(self._arm_state.Eval(context))[: self._num_joints]
        pose = self._arm.calc_pose(q)
        output.SetFromVector(calc_taxel_forces(self._layout, pose.R_RL, pose.p_RL, patches))


def read_patches(
    results: ContactResults, link_of: Callable[[GeometryId], int | None]
) -> list[ContactPatch]:
    """Returns the contacts between the arm's skin and other bodies.

    Args:
        results: Contact results of the plant.
        link_of: Returns the link index of a skin geometry, `BODY` for the rest of the robot, None
            for any other geometry.
    """
    surfaces = map(results.hydroelastic_contact_info, range(results.num_hydroelastic_contacts()))
    points = map(results.point_pair_contact_info, range(results.num_point_pair_contacts()))
    patches = [_read_surface(info, link_of) for info in surfaces]
    patches += [_read_point(info, link_of) for info in points]
    return [patch for patch in patches if patch is not None]


def _read_surface(
    info: HydroelasticContactInfo, link_of: Callable[[GeometryId], int | None]
) -> ContactPatch | None:
    """Reads a hydroelastic patch; its face normals point out of N, into M."""
    surface = info.contact_surface()
    link, sign = _felt(link_of(surface.id_N()), link_of(surface.id_M()))
    if link == BODY:
        return None
    pressure = surface.poly_e_MN()
    faces = range(surface.num_faces())
    p_WQ = [surface.centroid(i) for i in faces]
    normal = [surface.face_normal(i) for i in faces]
    force = [pressure.EvaluateCartesian(i, p_WQ[i]) * surface.area(i) for i in faces]
    return ContactPatch(link, np.array(p_WQ), sign * np.array(normal), np.array(force))


def _read_point(
    info: PointPairContactInfo, link_of: Callable[[GeometryId], int | None]
) -> ContactPatch | None:
    """Reads a point contact; Drake reports the force on body B."""
    pair = info.point_pair()
    link, sign = _felt(link_of(pair.id_A), link_of(pair.id_B))
    if link == BODY:
        return None
    n_R = -sign * np.asarray(pair.nhat_BA_W)
    force = max(0.0, float(sign * n_R @ info.contact_force()))
    p_RQ = np.asarray(info.contact_point())
    return ContactPatch(link, p_RQ[None], n_R[None], np.array([force]))


def _felt(first: int | None, second: int | None) -> tuple[int, float]:
    """Returns the link in contact, and 1 or -1 if it is the first or second geometry.

    The link is `BODY` unless exactly one of the geometries belongs to the robot.
    """
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
    pressure, as a contact does in the authors' simulator; a wider patch loads the taxels under its
    faces. No force is lost.

    Args:
        layout: The taxels.
        R_RL: Rotations of the k links, shape (k, 3, 3).
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
            # Not the sum of the magnitudes: facets of a coarse mesh and corners spread directions.
            f_L = force @ n_R @ R
            size = math.sqrt(f_L @ f_L)
            taxel = _nearest_facing(mine, force @ p_LQ / total, f_L)
            forces[mine.taxels[taxel]] += size
        else:
            np.add.at(forces, mine.taxels[under], force)
    return forces


def _nearest_facing(mine: LinkTaxels, p_LC: Vector, f_L: Vector) -> np.intp:
    """Returns the taxel nearest to the contact point C among those facing the force."""
    facing = mine.n_L @ f_L >= MAX_ANGLE_COS * math.sqrt(f_L @ f_L)
    distance = mine.compare_distances(p_LC)
    # If none faces it, the nearest of all.
    return np.argmin(np.where(facing, distance, np.inf) if facing.any() else distance)
