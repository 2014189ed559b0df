"""Bodies that can be pushed: on the ground against dry friction, or floating against drag."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    Joint,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
    UnitInertia,
)

from lic_drake.types import Vector

CARRIAGE_SHARE = 1e-3
"""Mass of a body that only carries another along one axis, as a share of the other's."""


def add_sliding_body(
    plant: MultibodyPlant,
    clutter: ModelInstanceIndex,
    name: str,
    mass: float,
    p_WO: Vector,
    friction_N: float,
    creep_m_per_s: float,
) -> RigidBody:
    """Adds a body that slides in the ground plane against dry friction.

    The friction is an actuator without stiffness: a strong damper whose force saturates, which
    Drake integrates implicitly. The actuators' desired-state port must get zeros.

    Args:
        plant: The plant.
        clutter: Model instance of the movable objects.
        name: The body's name.
        mass: Kilograms.
        p_WO: Position, shape (3,), metres.
        friction_N: Dry friction, N.
        creep_m_per_s: Speed up to which it grows.
    """
    # Friction acts along x and y apart, so its resistance to motion in a direction u is
    # limit (|u_x| + |u_y|), which over all directions has the mean 4/pi limit.
    limit = 0.25 * np.pi * friction_N
    gains = PdControllerGains(p=0.0, d=limit / creep_m_per_s)
    body, joints = _add_carried_body(plant, clutter, name, mass, p_WO[:2])
    for joint in joints:
        plant.AddJointActuator(joint.name(), joint, limit).set_controller_gains(gains)
    return body


def add_floating_body(
    plant: MultibodyPlant,
    clutter: ModelInstanceIndex,
    name: str,
    mass: float,
    p_WO: Vector,
    drag_N_s_per_m: float,
) -> RigidBody:
    """Adds a body that floats, without turning, against viscous drag.

    The drag is the damping of its joints, which Drake integrates implicitly: a thousandth of a
    second is all the memory that a light sphere has of its velocity.

    Args:
        plant: The plant.
        clutter: Model instance of the movable objects.
        name: The body's name.
        mass: Kilograms.
        p_WO: Position, shape (3,), metres.
        drag_N_s_per_m: Drag in every direction, N s/m.
    """
    body, _ = _add_carried_body(plant, clutter, name, mass, p_WO, drag_N_s_per_m)
    return body


def _add_carried_body(
    plant: MultibodyPlant,
    clutter: ModelInstanceIndex,
    name: str,
    mass: float,
    p_WO: Vector,
    damping: float = 0.0,
) -> tuple[RigidBody, list[Joint]]:
    """Adds a body that translates along x, y .. as far as p_WO goes, on light carriages."""
    names = [f"{name}_carriage", f"{name}_lift"][: len(p_WO) - 1]
    carriages = [
        plant.AddRigidBody(
            carriage,
            clutter,
            SpatialInertia(CARRIAGE_SHARE * mass, np.zeros(3), UnitInertia.SolidSphere(0.01)),
        )
        for carriage in names
    ]
    body = plant.AddRigidBody(
        name, clutter, SpatialInertia(mass, np.zeros(3), UnitInertia.SolidSphere(0.01))
    )
    joints: list[Joint] = []
    parent = plant.world_frame()
    for axis, child, offset, direction in zip(
        "xyz", (*carriages, body), p_WO, np.eye(3), strict=False
    ):
        joint = plant.AddJoint(
            PrismaticJoint(f"{name}_{axis}", parent, child.body_frame(), direction, damping=damping)
        )
        joint.set_default_positions(np.array([offset]))
        joints.append(joint)
        parent = child.body_frame()
    return body, joints
