"""What models/pr2/pr2.urdf says of the PR2, and what stands still while its right arm reaches."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from pydrake.geometry import Box, Cylinder, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
)

from lic_drake.paths import models_dir
from lic_drake.robots.pr2_kinematics import ArmLengths
from lic_drake.robots.skin_shape import SkinShape
from lic_drake.types import Vector

JOINTS = (
    "shoulder_pan",
    "shoulder_lift",
    "upper_arm_roll",
    "elbow_flex",
    "forearm_roll",
    "wrist_flex",
    "wrist_roll",
)
"""The joints of an arm, without side and suffix; each moves a link of its name."""

BASE_JOINTS = ("x", "y", "theta")
"""Joints of the mobile base."""
TORSO_JOINT = "torso_lift_joint"
"""Joint of the torso lift."""
TOOL_FRAME = "r_gripper_tool_frame"
"""Frame between the fingers of the right gripper."""

SOFT_LIMITS = (
    (-2.1353981634, 0.5646018366),
    (-0.3536, 1.2963),
    (-3.75, 0.65),
    (-2.1213, -0.15),
    (-np.inf, np.inf),
    (-1.994, -0.1),
    (-np.inf, np.inf),
)
"""Where the real robot's safety controllers begin to act on the right arm, radians.

Source: PR2/pr2_common, commit e1f9029 (BSD). URDF has a tag for them, which Drake does not read.
"""

TORSO_RANGE_M = (0.0115, 0.305)
"""Soft limits of the torso lift, metres (same source)."""

LEFT_ARM_AT_REST = (1.8, 1.0, 1.2, -1.9, -0.5, -0.6, 0.0)
"""Where we hold the left arm, radians: beside the body, out of the right arm's way."""


@dataclass(frozen=True, kw_only=True)
class Pr2Description:
    """The right arm as the model describes it.

    Attributes:
        p_FA: Position of the pan axis at the height of the arm in base_footprint, with the torso
            at 0, shape (3,), metres.
        lengths: Distances along the arm.
        q_min: Lower hard limits, shape (7,), radians; infinite for joints that turn for ever.
        q_max: Upper hard limits, shape (7,), radians.
        velocity_limit: Shape (7,), rad/s.
        effort_limit: Shape (7,), Nm.
        stiffness: Of the joint impedance, shape (7,), Nm/rad.
        damping: Of the joint impedance, without that of the joints, shape (7,), Nms/rad.
        surface: The collision shapes of the seven links.
    """

    p_FA: Vector
    lengths: ArmLengths
    q_min: Vector
    q_max: Vector
    velocity_limit: Vector
    effort_limit: Vector
    stiffness: Vector
    damping: Vector
    surface: tuple[SkinShape, ...]


def link_names(side: str = "r") -> tuple[str, ...]:
    """Returns the names of an arm's seven moving bodies, proximal to distal."""
    return tuple(f"{side}_{joint}_link" for joint in JOINTS)


def joint_names(side: str = "r") -> tuple[str, ...]:
    """Returns the names of an arm's seven joints, proximal to distal."""
    return tuple(f"{side}_{joint}_joint" for joint in JOINTS)


def add_pr2(plant: MultibodyPlant) -> ModelInstanceIndex:
    """Adds the robot with all its joints; the arms are spring-balanced, so without gravity."""
    (pr2,) = Parser(plant).AddModels(str(models_dir() / "pr2" / "pr2.urdf"))
    plant.set_gravity_enabled(pr2, False)
    return pr2


def weld_joints(
    plant: MultibodyPlant, pr2: ModelInstanceIndex, positions: Mapping[str, float]
) -> None:
    """Replaces joints by welds, before the plant is finalized.

    A frame with a joint's name is where the joint was, at its position. The pose of that frame in
    its parent can still be set in a context.

    `Joint.Lock` would do neither with an integrator's continuous plant nor save any time.

    Args:
        plant: The plant.
        pr2: The robot in it.
        positions: Position of each joint by its name, metres or radians.
    """
    for name, position in positions.items():
        joint = plant.GetJointByName(name, pr2)
        if isinstance(joint, PrismaticJoint):
            X_PC = RigidTransform(position * joint.translation_axis())
        else:
            assert isinstance(joint, RevoluteJoint)
            X_PC = RigidTransform(RotationMatrix.MakeFromOneVector(joint.revolute_axis(), 2))
            turn = RigidTransform(RotationMatrix.MakeZRotation(position))
            X_PC = X_PC @ turn @ X_PC.inverse()
        parent, child = joint.frame_on_parent(), joint.frame_on_child()
        plant.RemoveJoint(joint)
        plant.WeldFrames(plant.AddFrame(FixedOffsetFrame(name, parent, X_PC, pr2)), child)


@cache
def read_pr2() -> Pr2Description:
    """Returns what the model says, read once a process."""
    plant = MultibodyPlant(time_step=1e-3)
    scene_graph = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    pr2 = add_pr2(plant)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base_footprint"))
    weld_joints(plant, pr2, dict.fromkeys(BASE_JOINTS, 0.0) | {TORSO_JOINT: 0.0})
    plant.Finalize()
    context = plant.CreateDefaultContext()

    joints = [plant.GetJointByName(name) for name in joint_names()]
    frames = [joint.frame_on_parent() for joint in joints] + [plant.GetFrameByName(TOOL_FRAME)]
    p_FJ = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
    actuators = [plant.GetJointActuatorByName(joint.name()) for joint in joints]
    return Pr2Description(
        p_FA=p_FJ[0],
        lengths=ArmLengths(
            *np.linalg.norm(np.diff(p_FJ[[0, 1, 3, 5, 7]], axis=0), axis=1).tolist()
        ),
        q_min=np.array([joint.position_lower_limits()[0] for joint in joints]),
        q_max=np.array([joint.position_upper_limits()[0] for joint in joints]),
        velocity_limit=np.array([joint.velocity_upper_limits()[0] for joint in joints]),
        effort_limit=np.array([actuator.effort_limit() for actuator in actuators]),
        stiffness=np.array([actuator.get_controller_gains().p for actuator in actuators]),
        damping=np.array([actuator.get_controller_gains().d for actuator in actuators]),
        surface=tuple(
            shape for name in link_names() for shape in _read_surface(plant, scene_graph, name)
        ),
    )


def _read_surface(plant: MultibodyPlant, scene_graph: SceneGraph, link: str) -> list[SkinShape]:
    """Returns the collision shapes of a link."""
    inspector = scene_graph.model_inspector()
    shapes = []
    for geometry in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link)):
        shape, X_LS = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
        # Copies: what a plant has returned may keep it alive.
        R_LS, p_LS = np.array(X_LS.rotation().matrix()), np.array(X_LS.translation())
        if isinstance(shape, Box):
            size = tuple(shape.size().tolist())
            shapes.append(SkinShape(link=link, kind="box", size=size, R_LS=R_LS, p_LS=p_LS))
        elif isinstance(shape, Cylinder):
            size = (shape.radius(), shape.length())
            shapes.append(SkinShape(link=link, kind="cylinder", size=size, R_LS=R_LS, p_LS=p_LS))
        else:
            raise ValueError(f"{link}: neither a box nor a cylinder: {type(shape).__name__}")
    return shapes
