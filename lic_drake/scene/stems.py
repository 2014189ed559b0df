"""Stems that bend away when they are pushed, with their leaves."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    GeometryId,
    GeometrySet,
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

from lic_drake.clutter.stems import Stems
from lic_drake.scene.looks import BRANCH_COLOR, LEAF_COLORS, STEM_COLOR
from lic_drake.scene.movables import CARRIAGE_SHARE

Vector = NDArray[np.float64]


def add_stems(
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    clutter: ModelInstanceIndex,
    stems: Stems,
    properties: Callable[[], ProximityProperties],
    visuals: bool = False,
) -> list[GeometryId]:
    """Adds stems, each on two joints across it at its root, and what they carry.

    The springs are actuators that want to be at 0: Drake integrates them implicitly. The
    actuators' desired-state port must get zeros. Leaves move with their stem. Stems and leaves do
    not touch each other: real leaves fold and slide past one another, rigid plates would jam.

    Args:
        plant: The plant.
        scene_graph: Its scene graph.
        clutter: Model instance of what can be pushed; its positions are the angles about Sx and
            Sy of one springy stem after the other.
        stems: The stems.
        properties: Makes the contact properties of a stem or a leaf.
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
            plant.RegisterVisualGeometry(
                body, _root_in_body(stems, i) @ X_SO, shape, f"stem{i}_visual", color
            )
    for j, i in enumerate(stems.leaf_stem):
        X_SL = RigidTransform(RotationMatrix(stems.R_SL[j]), stems.p_SL[j])
        X_BL = _root_in_body(stems, i) @ X_SL
        geometries.append(
            plant.RegisterCollisionGeometry(
                bodies[i], X_BL, Box(stems.leaf_size[j]), f"leaf{j}_collision", properties()
            )
        )
        if visuals:
            plant.RegisterVisualGeometry(
                bodies[i],
                X_BL,
                _leaf_shape(stems.leaf_size[j]),
                f"leaf{j}_visual",
                LEAF_COLORS[j % len(LEAF_COLORS)],
            )
    scene_graph.collision_filter_manager().Apply(
        CollisionFilterDeclaration().ExcludeWithin(GeometrySet(geometries))
    )
    return geometries


def _root_in_body(stems: Stems, i: int) -> RigidTransform:
    """Returns the stem's frame S in its body: the world, or a body of its own whose frame it is."""
    if stems.fixed[i]:
        return RigidTransform(RotationMatrix(stems.R_WS[i]), stems.p_WH[i])
    return RigidTransform()


def _leaf_shape(size: Vector) -> Convex:
    """Returns what a leaf looks like: an oval, pointed where it ends, within the plate's edges.

    As an ellipsoid every leaf would be drawn with thousands of triangles.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    along = np.cos(angle)
    across = np.sin(angle) * (1.0 - 0.35 * np.maximum(along, 0.0))
    rim = np.stack([along, across / np.abs(across).max(), np.zeros_like(angle)])
    middle = np.array([[-0.1, -0.1], [0.0, 0.0], [1.0, -1.0]])
    points = 0.5 * size[:, np.newaxis] * np.hstack([rim, middle])
    return Convex(points, "leaf")


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
