"""Bodies that can be pushed: on the ground against dry friction, or floating against drag."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
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
    """Adds a body that translates without turning: on the ground, or floating in space.

    On the ground it slides against dry friction: actuators without stiffness, strong dampers whose
    force saturates. A floating body meets viscous drag, the damping of its joints: a thousandth of
    a second is all the memory that a light sphere has of its velocity. Drake integrates both
    implicitly.

    Args:
        plant: The plant.
        clutter: Model instance of the movable objects.
        name: The body's name.
        mass: Kilograms.
        p_WO: Position along the axes in which it moves, metres: shape (2,) on the ground, shape
            (3,) in space.
        friction_N: Dry friction on the ground, N.
        creep_m_per_s: Speed up to which it grows.
        drag_N_s_per_m: Drag in space in every direction, N s/m.
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
    # Friction acts along x and y apart, so its resistance to motion in a direction u is
    # limit (|u_x| + |u_y|), which over all directions has the mean 4/pi limit.
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
