"""Stems that bend away when they are pushed, with their leaves."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
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
    RevoluteJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from lic_drake.clutter.instance import Stems
from lic_drake.scene.looks import BRANCH_COLOR, LEAF_COLORS, STEM_COLOR
from lic_drake.scene.movables import CARRIAGE_SHARE

_RIM_POINTS = 12
"""Corners of a leaf as it is drawn."""


def add_stems(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    clutter: ModelInstanceIndex,
    stems: Stems,
    properties: Callable[[], ProximityProperties],
    objects: Sequence[GeometryId],
    visuals: bool = False,
) -> list[GeometryId]:
    """Adds stems, each on two joints across it at its root, and what they carry.

    The springs are actuators that want to be at 0: Drake integrates them implicitly. The
    actuators' desired-state port must get zeros. Leaves move with their stem. Stems and leaves
    touch neither each other nor the objects in which they are rooted, only the robot: real leaves
    fold and slide past one another, rigid plates would jam.

    Args:
        plant: The plant.
        scene_graph: Its scene graph.
        clutter: Model instance of what can be pushed; its positions are the angles about Sx and
            Sy of one springy stem after the other.
        stems: The stems.
        properties: Makes the contact properties of a stem or a leaf.
        objects: Collision geometry of the environment's other objects.
        visuals: Whether they can be seen.

    Returns:
        Collision geometry of the stems, and then of the leaves.
    """
    bodies: list[RigidBody] = []
    for i in range(stems.num_stems):
        if stems.fixed[i]:
            bodies.append(plant.world_body())
        else:
            bodies.append(_add_hinged_body(plant, clutter, f"stem{i}", stems, i))
    geometries = []
    for i, body in enumerate(bodies):
        X_SO = RigidTransform(np.array([0.0, 0.0, 0.5 * stems.length[i]]))
        shape = Cylinder(stems.radius[i], stems.length[i])
        geometries.append(
            plant.RegisterCollisionGeometry(
                body, _root_in_body(stems, i) @ X_SO, shape, f"stem{i}_collision", properties()
            )
        )
        if visuals:
            color = BRANCH_COLOR if stems.fixed[i] else STEM_COLOR
            X_BS = _root_in_body(stems, i)
            plant.RegisterVisualGeometry(body, X_BS @ X_SO, shape, f"stem{i}_visual", color)
            for k, leaf_color in enumerate(LEAF_COLORS):
                leaves = np.flatnonzero(stems.leaf_stem == i)[k :: len(LEAF_COLORS)]
                if len(leaves):
                    mesh = _leaf_mesh(stems, leaves)
                    plant.RegisterVisualGeometry(
                        body, X_BS, mesh, f"stem{i}_leaves{k}_visual", leaf_color
                    )
    for j, i in enumerate(stems.leaf_stem):
        X_SL = RigidTransform(RotationMatrix(stems.R_SL[j]), stems.p_SL[j])
        X_BL = _root_in_body(stems, i) @ X_SL
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
    return geometries


def _root_in_body(stems: Stems, i: int) -> RigidTransform:
    """Returns the stem's frame S in its body: the world, or a body of its own whose frame it is."""
    if stems.fixed[i]:
        return RigidTransform(RotationMatrix(stems.R_WS[i]), stems.p_WH[i])
    return RigidTransform()


def _leaf_mesh(stems: Stems, leaves: NDArray[np.intp]) -> Mesh:
    """Returns what leaves of a stem look like, in its frame: ovals within the plates' edges.

    They are one mesh, because a renderer takes longer the more geometries there are.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, _RIM_POINTS, endpoint=False)
    # Broadest before the middle, and with a ridge along it.
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
