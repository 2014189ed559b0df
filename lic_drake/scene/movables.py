"""Movable bodies: sliding against dry friction, floating against drag, or stems on springs."""

from collections.abc import Sequence

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Cylinder,
    GeometryId,
    GeometrySet,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from lic_drake.clutter.instance import Stems
from lic_drake.scene.contact import BRANCH_COLOR, LEAF_COLORS, STEM_COLOR
from lic_drake.types import IntVector, Vector

CARRIAGE_SHARE = 1e-3
"""Mass of an intermediate body between two joints, as a share of the carried body's."""
_RIM_POINTS = 12  # Corners of a leaf's visual mesh.


def add_movable(
    plant: MultibodyPlant,
    clutter: ModelInstanceIndex,
    name: str,
    mass: float,
    p_WO: Vector,
    *,
    friction_N: float,
    creep_m_per_s: float,
    drag_N_s_per_m: float,
) -> RigidBody:
    """Adds a body that only translates, at p_WO: on the ground (2,) or floating in space (3,).

    On the ground, dry friction is modelled by actuators without stiffness: strong dampers whose
    force saturates, at the speed `creep_m_per_s`. In space, viscous drag is the damping of the
    joints. Drake integrates both implicitly.
    """
    floats = len(p_WO) == 3
    # Friction acts along x and y separately: its resistance to motion in a direction u is
    # limit (|u_x| + |u_y|), with the mean 4/pi limit over all directions.
    limit = 0.25 * np.pi * friction_N
    gains = PdControllerGains(p=0.0, d=limit / creep_m_per_s)
    damping = drag_N_s_per_m if floats else 0.0
    links = [f"{name}_carriage", f"{name}_lift"][: len(p_WO) - 1] + [name]
    parent = plant.world_frame()
    for axis, link, offset, direction in zip("xyz", links, p_WO, np.eye(3), strict=False):
        share = mass if link == name else CARRIAGE_SHARE * mass
        inertia = SpatialInertia(share, np.zeros(3), UnitInertia.SolidSphere(0.01))
        body = plant.AddRigidBody(link, clutter, inertia)
        joint = plant.AddJoint(
            PrismaticJoint(f"{name}_{axis}", parent, body.body_frame(), direction, damping=damping)
        )
        joint.set_default_positions(np.array([offset]))
        if not floats:
            plant.AddJointActuator(joint.name(), joint, limit).set_controller_gains(gains)
        parent = body.body_frame()
    return body


def add_stems(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    clutter: ModelInstanceIndex,
    stems: Stems,
    properties: ProximityProperties,
    objects: Sequence[GeometryId],
    visuals: bool,
) -> None:
    """Adds stems with their leaves, each elastic stem on two joints across it at its root.

    The springs are actuators whose desired state must be 0: Drake integrates them implicitly. Stems
    and leaves only touch the robot, neither each other nor the other objects: real leaves fold and
    slide past one another, rigid plates would jam.

    The clutter's positions are the angles about Sx and Sy of one elastic stem after the other;
    `properties` are of the contact with stems and leaves, `objects` the collision geometry of all
    other objects.
    """
    bodies: list[RigidBody] = []
    roots: list[RigidTransform] = []  # X_BS of each stem.
    for i in range(stems.num_stems):
        fixed = stems.fixed[i]
        bodies.append(plant.world_body() if fixed else _add_hinged_body(plant, clutter, stems, i))
        roots.append(_root(stems, i) if fixed else RigidTransform())
    geometries = []
    for i, (body, X_BS) in enumerate(zip(bodies, roots, strict=True)):
        X_BO = X_BS @ RigidTransform(np.array([0.0, 0.0, 0.5 * stems.length[i]]))
        shape = Cylinder(stems.radius[i], stems.length[i])
        geometries.append(
            plant.RegisterCollisionGeometry(body, X_BO, shape, f"stem{i}_collision", properties)
        )
        if visuals:
            color = BRANCH_COLOR if stems.fixed[i] else STEM_COLOR
            plant.RegisterVisualGeometry(body, X_BO, shape, f"stem{i}_visual", color)
            for k, leaf_color in enumerate(LEAF_COLORS):
                leaves = np.flatnonzero(stems.leaf_stem == i)[k :: len(LEAF_COLORS)]
                if len(leaves):
                    mesh = _leaf_mesh(stems, leaves)
                    plant.RegisterVisualGeometry(
                        body, X_BS, mesh, f"stem{i}_leaves{k}_visual", leaf_color
                    )
    for j, i in enumerate(stems.leaf_stem):
        X_BL = roots[i] @ RigidTransform(RotationMatrix(stems.R_SL[j]), stems.p_SL[j])
        leaf, name = Box(stems.leaf_size[j]), f"leaf{j}_collision"
        geometries.append(plant.RegisterCollisionGeometry(bodies[i], X_BL, leaf, name, properties))
    grown = GeometrySet(geometries)
    scene_graph.collision_filter_manager().Apply(
        CollisionFilterDeclaration()
        .ExcludeWithin(grown)
        .ExcludeBetween(grown, GeometrySet(objects))
    )


def _leaf_mesh(stems: Stems, leaves: IntVector) -> Mesh:
    """Returns one visual mesh, faster to render than many, of leaves of a stem as ovals, in S."""
    angle = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    # Widest before the middle, with a ridge along it.
    rim = np.stack([np.cos(angle), np.sin(angle) * (1.0 - 0.3 * np.cos(angle)), 0.0 * angle])
    rim[1] /= rim[1].max()
    ridge = np.array([[-0.1, -0.1], [0.0, 0.0], [1.0, -1.0]])
    points = 0.5 * np.hstack([rim, ridge])
    top, bottom = _RIM_POINTS, _RIM_POINTS + 1
    sides = [(k, (k + 1) % _RIM_POINTS) for k in range(_RIM_POINTS)]
    faces = np.array([(a, b, top) for a, b in sides] + [(b, a, bottom) for a, b in sides])
    vertices, normals, triangles = list[str](), list[str](), list[str]()
    for n, j in enumerate(leaves):
        p_SQ = stems.p_SL[j] + (points.T * stems.leaf_size[j]) @ stems.R_SL[j].T
        a, b, c = np.moveaxis(p_SQ[faces], 1, 0)
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        vertices += ["v {:.6f} {:.6f} {:.6f}".format(*p) for p in p_SQ]
        normals += ["vn {:.6f} {:.6f} {:.6f}".format(*v) for v in normal]
        for k, face in enumerate(1 + faces + n * len(p_SQ), start=1 + n * len(faces)):
            triangles.append("f {0}//{3} {1}//{3} {2}//{3}".format(*face, k))
    lines = vertices + normals + triangles
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "leaves")))


def _root(stems: Stems, i: int) -> RigidTransform:
    return RigidTransform(RotationMatrix(stems.R_WS[i]), stems.p_WH[i])


def _add_hinged_body(
    plant: MultibodyPlant, clutter: ModelInstanceIndex, stems: Stems, i: int
) -> RigidBody:
    name, mass, radius = f"stem{i}", stems.mass[i], stems.radius[i]
    parent: Frame = plant.AddFrame(
        FixedOffsetFrame(f"{name}_root", plant.world_frame(), _root(stems, i), clutter)
    )
    hub = SpatialInertia(CARRIAGE_SHARE * mass, np.zeros(3), UnitInertia.SolidSphere(radius))
    stem = SpatialInertia.SolidCylinderWithMassAboutEnd(
        mass, radius, stems.length[i], np.array([0.0, 0.0, 1.0])
    )
    gains = PdControllerGains(p=stems.stiffness[i], d=stems.damping[i])
    for axis, link, inertia, direction in (
        ("x", f"{name}_hub", hub, [1.0, 0.0, 0.0]),
        ("y", name, stem, [0.0, 1.0, 0.0]),
    ):
        body = plant.AddRigidBody(link, clutter, inertia)
        joint = plant.AddJoint(
            RevoluteJoint(f"{name}_{axis}", parent, body.body_frame(), np.array(direction))
        )
        plant.AddJointActuator(joint.name(), joint).set_controller_gains(gains)
        parent = body.body_frame()
    return body
