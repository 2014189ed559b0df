"""Movable bodies: sliding against dry friction, floating against drag, or stems on springs."""

from collections.abc import Callable, Sequence

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
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from lic_drake.clutter.instance import Stems
from lic_drake.scene.looks import BRANCH_COLOR, LEAF_COLORS, STEM_COLOR
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
    """Adds a body that only translates, on the ground or floating in space.

    On the ground, dry friction is modelled by actuators without stiffness: strong dampers whose
    force saturates. In space, viscous drag is the damping of the joints. Drake integrates both
    implicitly.

    Args:
        plant: The plant.
        clutter: Model instance of the movable objects.
        name: The body's name.
        mass: Kilograms.
        p_WO: Position, metres, shape (2,) on the ground or (3,) in space.
        friction_N: Dry friction on the ground, N.
        creep_m_per_s: Speed at which it saturates.
        drag_N_s_per_m: Drag in space, N s/m.
    """
    floats = len(p_WO) == 3
    names = [f"{name}_carriage", f"{name}_lift"][: len(p_WO) - 1]
    carried = [(carriage, CARRIAGE_SHARE * mass) for carriage in names]
    bodies = [
        plant.AddRigidBody(
            body, clutter, SpatialInertia(share, np.zeros(3), UnitInertia.SolidSphere(0.01))
        )
        for body, share in (*carried, (name, mass))
    ]
    # Friction acts along x and y separately: its resistance to motion in a direction u is
    # limit (|u_x| + |u_y|), with the mean 4/pi limit over all directions.
    limit = 0.25 * np.pi * friction_N
    gains = PdControllerGains(p=0.0, d=limit / creep_m_per_s)
    parent = plant.world_frame()
    for axis, body, offset, direction in zip("xyz", bodies, p_WO, np.eye(3), strict=False):
        joint = plant.AddJoint(
            PrismaticJoint(
                f"{name}_{axis}",
                parent,
                body.body_frame(),
                direction,
                damping=drag_N_s_per_m if floats else 0.0,
            )
        )
        joint.set_default_positions(np.array([offset]))
        if not floats:
            plant.AddJointActuator(joint.name(), joint, limit).set_controller_gains(gains)
        parent = body.body_frame()
    return bodies[-1]


def add_stems(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    clutter: ModelInstanceIndex,
    stems: Stems,
    properties: Callable[[], ProximityProperties],
    objects: Sequence[GeometryId],
    visuals: bool,
) -> None:
    """Adds stems with their leaves, each elastic stem on two joints across it at its root.

    The springs are actuators whose desired state must be 0: Drake integrates them implicitly. Stems
    and leaves only touch the robot, neither each other nor the other objects: real leaves fold and
    slide past one another, rigid plates would jam.

    Args:
        plant: The plant.
        scene_graph: Its scene graph.
        clutter: Model instance of movable objects; its positions are the angles about Sx and Sy of
            one elastic stem after the other.
        stems: The stems.
        properties: Returns the contact properties of a stem or a leaf.
        objects: Collision geometry of the environment's other objects.
        visuals: Whether they have visual geometry.
    """
    bodies: list[RigidBody] = []
    roots: list[RigidTransform] = []  # X_BS of each stem.
    for i in range(stems.num_stems):
        X_WS = RigidTransform(RotationMatrix(stems.R_WS[i]), stems.p_WH[i])
        if stems.fixed[i]:
            bodies.append(plant.world_body())
        else:
            bodies.append(_add_hinged_body(plant, clutter, f"stem{i}", stems, i))
        roots.append(X_WS if stems.fixed[i] else RigidTransform())
    geometries = []
    for i, (body, X_BS) in enumerate(zip(bodies, roots, strict=True)):
        X_BO = X_BS @ RigidTransform(np.array([0.0, 0.0, 0.5 * stems.length[i]]))
        shape = Cylinder(stems.radius[i], stems.length[i])
        geometries.append(
            plant.RegisterCollisionGeometry(body, X_BO, shape, f"stem{i}_collision", properties())
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
        geometries.append(
            plant.RegisterCollisionGeometry(
                bodies[i], X_BL, Box(stems.leaf_size[j]), f"leaf{j}_collision", properties()
            )
        )
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
    faces = [(a, b, top) for a, b in sides] + [(b, a, bottom) for a, b in sides]
    vertices: list[str] = []
    normals: list[str] = []
    triangles: list[str] = []
    for j in leaves:
        p_SQ = stems.p_SL[j] + (points.T * stems.leaf_size[j]) @ stems.R_SL[j].T
        first = 1 + len(vertices)
        vertices += ["v {:.6f} {:.6f} {:.6f}".format(*p) for p in p_SQ]
        for a, b, c in faces:
            normal = np.cross(p_SQ[b] - p_SQ[a], p_SQ[c] - p_SQ[a])
            normals.append("vn {:.6f} {:.6f} {:.6f}".format(*normal / np.linalg.norm(normal)))
            n = len(normals)
            triangles.append(f"f {first + a}//{n} {first + b}//{n} {first + c}//{n}")
    lines = vertices + normals + triangles
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines) + "\n", ".obj", "leaves")))


def _add_hinged_body(
    plant: MultibodyPlant, clutter: ModelInstanceIndex, name: str, stems: Stems, i: int
) -> RigidBody:
    root = plant.AddFrame(
        FixedOffsetFrame(
            f"{name}_root",
            plant.world_frame(),
            RigidTransform(RotationMatrix(stems.R_WS[i]), stems.p_WH[i]),
            clutter,
        )
    )
    mass, length, radius = stems.mass[i], stems.length[i], stems.radius[i]
    hub = plant.AddRigidBody(
        f"{name}_hub",
        clutter,
        SpatialInertia(CARRIAGE_SHARE * mass, np.zeros(3), UnitInertia.SolidSphere(radius)),
    )
    body = plant.AddRigidBody(
        name,
        clutter,
        SpatialInertia.SolidCylinderWithMassAboutEnd(mass, radius, length, np.eye(3)[2]),
    )
    gains = PdControllerGains(p=stems.stiffness[i], d=stems.damping[i])
    for axis, parent, child, direction in zip(
        "xy",
        (root, hub.body_frame()),
        (hub.body_frame(), body.body_frame()),
        np.eye(3)[:2],
        strict=True,
    ):
        joint = plant.AddJoint(RevoluteJoint(f"{name}_{axis}", parent, child, direction))
        plant.AddJointActuator(joint.name(), joint).set_controller_gains(gains)
    return body
