"""`Arm`: a robot arm with an impedance controller and a tactile skin, from a model file."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import cast

import numpy as np
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    Frame,
    ModelInstanceIndex,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.framework import Context

from lic_drake.errors import ScenarioError
from lic_drake.robots.kinematics import ArmPose, Kinematics
from lic_drake.robots.skin import SkinShape as SkinShape
from lic_drake.robots.skin import read_skin
from lic_drake.types import IntVector, Vector

_FLOOR = "floor_mount"
_BASE_COLOR = np.array([0.35, 0.35, 0.38, 1.0])


class Arm:
    """An arm on a base that stands still during a reach; all vectors are in its base frame R.

    All joints of the model that are neither held nor those of the carriage are the arm's. They must
    be revolute, with limits and with an actuator that has controller gains: the joint impedance,
    which Drake integrates implicitly.

    Args:
        name: Name in scenario files.
        model: URDF or SDF file, or URDF text.
        base_frame: Frame that is welded to R.
        tip_frame: Frame E of the hand, which points along Ex.
        skin_links: Bodies whose collision shapes are skin, proximal to distal; by default those
            that the joints move and that have such shapes.
        q_min: Lower joint limits, shape (m,), radians, where narrower than the model's.
        q_max: Upper joint limits, shape (m,), radians.
        held: Joints that are held at positions, metres or radians.
        carriage: The joints along x, y and z that carry R in the model of a mobile robot.
        height_range_m: Lowest and highest position of R along z, metres.
        is_planar: Whether the arm moves in the plane z = 0; hand poses are then (x, y, phi).
        home: A posture by joint, radians, 0 where left out; by default in the middle of the limits.
        digest: Tells robots of the same name apart; by default the name.
        mpc: Values of the controller that suit the gains; a scenario may override them.
        fit: Changes the parsed model, as a robot file wants it, and gives the arm a pedestal.
        kinematics: A class that knows some of the kinematics in closed form.

    Attributes:
        link_names: Names of the bodies that carry skin.
        skin: Their collision shapes.
        joint_names: Names of the m joints.
        q_home: The posture, within the limits, shape (m,), radians.
        stiffness: Joint stiffness of the impedance controller, shape (m,), Nm/rad.
        damping: Its joint damping, shape (m,), Nms/rad.
        p_RJ: Origins of the m joints and of the tip at q = 0, shape (m + 1, 3), metres.
        p_RS: The point of the first axis beside the second joint, about which the whole arm turns,
            shape (3,), metres.
        reach_m: Upper bound of the tip's distance from it, metres.

    Raises:
        ScenarioError: The model cannot be read or is not such an arm.
    """

    def __init__(
        self,
        name: str,
        model: str | Path,
        *,
        base_frame: str = "base",
        tip_frame: str = "tip",
        skin_links: Sequence[str] | None = None,
        q_min: Vector | None = None,
        q_max: Vector | None = None,
        held: Mapping[str, float] | None = None,
        carriage: Sequence[str] | None = None,
        height_range_m: tuple[float, float] = (-np.inf, np.inf),
        is_planar: bool = False,
        home: Mapping[str, float] | None = None,
        digest: str = "",
        mpc: Mapping[str, float] | None = None,
        fit: Callable[[MultibodyPlant, ModelInstanceIndex], None] | None = None,
        kinematics: type[Kinematics] = Kinematics,
    ) -> None:
        self.name, self.is_planar, self.digest = name, is_planar, digest or name
        self.base_frame, self.tip_frame = base_frame, tip_frame
        self._model, self._held, self._carriage, self._fit = model, dict(held or {}), carriage, fit
        self.mpc = dict(mpc or {})
        self.height_range_m = height_range_m
        plant = MultibodyPlant(time_step=1e-3)
        scene_graph = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        try:
            self._read(plant, scene_graph, skin_links, (q_min, q_max), home, kinematics)
        # What Drake demands of a model, such as limits in order, ends as a SystemExit.
        except (OSError, RuntimeError, ValueError, SystemExit) as error:
            raise ScenarioError(
                f"the model of {name} does not describe {'a planar' if is_planar else 'an'} arm:"
                f" {' '.join(str(error).split())}"
            ) from error
        self._last: tuple[bytes, ArmPose] = (b"", self.kinematics.calc_pose(self.q_min))

    @property
    def num_joints(self) -> int:
        """Number of joints m."""
        return len(self.q_min)

    @cached_property
    def levers(self) -> Vector:
        """How far the axis of any skin shape can be from each joint, at most, (m,), metres."""
        pose = self.calc_pose(np.zeros(self.num_joints))
        along = np.append(0.0, np.linalg.norm(np.diff(self.p_RJ, axis=0), axis=1).cumsum())
        levers = np.zeros(self.num_joints)
        for capsule in (shape.enclosing_capsule() for shape in self.skin):
            link = self.link_names.index(capsule.link)
            last = int(self._moves[link].sum()) - 1
            centre = pose.p_RL[link] + pose.R_RL[link] @ capsule.p_LS
            beyond = 0.5 * capsule.size[1] + math.dist(centre, self.p_RJ[last])
            reach = along[last] - along[: last + 1] + beyond
            levers[: last + 1] = np.maximum(levers[: last + 1], reach)
        return levers

    @property
    def pose_size(self) -> int:
        """Length of a hand pose x0: 3 in the plane, else 7."""
        return 3 if self.is_planar else 7

    def calc_pose(self, q: Vector) -> ArmPose:
        """Returns where links and tip are at joint angles q, shape (m,), with Jacobians."""
        # Sensor, controller and stop rules ask for the same configuration, one after the other.
        key = q.tobytes()
        if key != self._last[0]:
            self._last = (key, self.kinematics.calc_pose(q))
        return self._last[1]

    def point_jacobians(self, pose: ArmPose, links: IntVector, p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ, shape (n, 3, m), m/rad, of points p_RQ, shape (n, 3), on skin links."""
        jacobians: Vector = (p_RQ @ pose.turn).reshape(-1, 3, self.num_joints) - pose.moment
        jacobians *= self._moves[links][:, None]
        return jacobians

    def tip_pose(self, q: Vector) -> Vector:
        """Returns the hand pose x0 in R, shape (pose_size,)."""
        return self.kinematics.tip_pose(q)

    def solve_ik(self, x0_R: Vector, near: Vector | None = None) -> Vector:
        """See `Kinematics.solve_ik`."""
        return self.kinematics.solve_ik(x0_R, near)

    def solve_pointing(self, p_RE: Vector, u_R: Vector) -> list[Vector]:
        """See `Kinematics.solve_pointing`."""
        return self.kinematics.solve_pointing(p_RE, u_R)

    def positions(self, b0: Vector, q: Vector) -> Vector:
        """Returns the positions of the mobile arm in a plant for q, shape (.., m): (.., 3 + m)."""
        return np.concatenate([np.broadcast_to(b0, (*q.shape[:-1], 3)), q], axis=-1)

    def add_to_plant(
        self,
        plant: MultibodyPlant,
        parent: Frame | None = None,
        mobile: bool = False,
        height_m: float = 0.0,
    ) -> ModelInstanceIndex:
        """Adds the arm without gravity: arms are balanced or move in a horizontal plane.

        `parent`, by default the world's frame, becomes R, `height_m` above the floor of a robot
        with a torso, see `set_height`. If `mobile`, b0 = (x, y, z) are positions, too, as in
        `positions`, of joints that nothing drives.
        """
        if isinstance(self._model, Path):
            (arm,) = Parser(plant).AddModels(str(self._model))
        else:
            kind = "sdf" if "<sdf" in self._model[:1000] else "urdf"
            (arm,) = Parser(plant).AddModelsFromString(self._model, kind)
        plant.set_gravity_enabled(arm, False)
        if self._fit is not None:
            self._fit(plant, arm)
        held = dict(self._held)
        parent = parent or plant.world_frame()
        if mobile and self._carriage is None:
            # A pedestal is seen itself.
            parent = _add_carriage(plant, arm, parent, visible=self._fit is None)
        elif self._carriage is not None and not mobile:
            held |= dict(zip(self._carriage, (0.0, 0.0, height_m), strict=True))
            X_RF = RigidTransform(np.array([0.0, 0.0, -height_m]))
            parent = plant.AddFrame(FixedOffsetFrame(_FLOOR, parent, X_RF, arm))
        plant.WeldFrames(parent, plant.GetFrameByName(self.base_frame, arm))
        _hold_joints(plant, arm, held)
        return arm

    def set_height(
        self, plant: MultibodyPlant, context: Context, arm: ModelInstanceIndex, height_m: float
    ) -> None:
        """Moves the robot's body to another height of its torso; arm and R stay where they are.

        The one place where a reach's diagram knows of a torso: the body hangs from R, how far R is
        above the robot's floor, and arm and body must not collide.
        """
        if self._carriage is not None:
            for name, z in ((_FLOOR, -height_m), (self._carriage[2], height_m)):
                frame = cast(FixedOffsetFrame, plant.GetFrameByName(name, arm))
                frame.SetPoseInParentFrame(context, RigidTransform(np.array([0.0, 0.0, z])))

    def check_height(self, height_m: float) -> None:
        """Raises a `ScenarioError` if R cannot be at this height."""
        low, high = self.height_range_m
        if not low <= height_m <= high:
            raise ScenarioError(
                f"the torso of {self.name} must be from {low} to {high} m high, got {height_m}"
            )

    def _read(
        self,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        skin_links: Sequence[str] | None,
        limits: tuple[Vector | None, Vector | None],
        home: Mapping[str, float] | None,
        kinematics: type[Kinematics],
    ) -> None:
        """Takes everything but names from the model; Drake's errors are RuntimeErrors."""
        arm = self.add_to_plant(plant)
        plant.Finalize()
        joints = [plant.get_joint(index) for index in plant.GetJointIndices(arm)]
        joints = [joint for joint in joints if joint.num_positions()]
        joints.sort(key=lambda joint: joint.position_start())
        for joint in joints:
            if not isinstance(joint, RevoluteJoint):
                raise ValueError(f"joint {joint.name()} is not revolute; hold it at a position")
        if not joints or len(joints) != plant.num_positions():
            raise ValueError(
                f"it has {len(joints)} revolute joints and {plant.num_positions()} positions"
            )
        self.joint_names = tuple(joint.name() for joint in joints)
        low, high = plant.GetPositionLowerLimits().copy(), plant.GetPositionUpperLimits().copy()
        self.q_min = low if limits[0] is None else np.maximum(low, limits[0])
        self.q_max = high if limits[1] is None else np.minimum(high, limits[1])
        for joint, ends in zip(joints, zip(self.q_min, self.q_max, strict=True), strict=True):
            if not np.all(np.isfinite(ends)):
                raise ValueError(f"joint {joint.name()} has no limits; give both of them")
        self.q_home = 0.5 * (self.q_min + self.q_max)
        if home is not None:
            self.q_home = np.array([home.get(joint.name(), 0.0) for joint in joints])
            beyond = np.maximum(self.q_min - self.q_home, self.q_home - self.q_max)
            if np.any(beyond > 0.0):
                worst = self.joint_names[int(np.argmax(beyond))]
                raise ValueError(f"joint {worst} is beyond its limits in the home posture")
        actuators = map(plant.get_joint_actuator, plant.GetJointActuatorIndices(arm))
        gains = {
            a.joint().name(): a.get_controller_gains() for a in actuators if a.has_controller()
        }
        ordered = [name for name in gains if name in self.joint_names]
        for joint in joints:
            if joint.name() not in gains:
                raise ValueError(
                    f"joint {joint.name()} needs an actuator with controller gains, or in a robot"
                    " file stiffness and damping"
                )
        if ordered != list(self.joint_names):  # In which the plant takes the desired state.
            raise ValueError(f"actuators must be in the order of the joints, got {ordered}")
        self.stiffness = np.array([gains[joint.name()].p for joint in joints])
        self.damping = np.array([gains[joint.name()].d for joint in joints])

        moved = [plant.GetBodiesKinematicallyAffectedBy([joint.index()]) for joint in joints]
        if skin_links is None:
            skin_links = [
                body.name()
                for body in map(plant.get_body, moved[0])
                if plant.GetCollisionGeometriesForBody(body)
            ]
        self.link_names = tuple(skin_links)
        links = [plant.GetBodyByName(link, arm) for link in skin_links]
        inspector = scene_graph.model_inspector()
        self.skin = tuple(shape for link in links for shape in read_skin(plant, inspector, link))
        bare = sorted(set(self.link_names) - {shape.link for shape in self.skin})
        if bare or not self.skin:
            raise ValueError(
                f"every skin link needs a collision shape: {', '.join(bare)} has none"
                if bare
                else "every skin link needs a collision shape, and no moving link has one"
            )
        if self.is_planar and any(shape.kind != "capsule" for shape in self.skin):
            raise ValueError("the skin of a planar arm must be capsules")
        self._moves = np.array([[float(link.index() in by) for by in moved] for link in links])

        context = plant.CreateDefaultContext()
        inertias = np.diag(plant.CalcMassMatrix(context))
        for joint, bodies, inertia in zip(joints, moved, inertias, strict=True):
            if not min(inertia, sum(plant.get_body(body).default_mass() for body in bodies)) > 0.0:
                raise ValueError(f"joint {joint.name()} moves no mass; give its link an inertia")
        tip = plant.GetFrameByName(self.tip_frame, arm)
        frames = [joint.frame_on_parent() for joint in joints] + [tip]
        self.p_RJ = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
        self.kinematics = kinematics(self, plant, [link.body_frame() for link in links], tip)
        # Along its axis the first joint does not move the next one.
        axis = self.kinematics.calc_pose(np.zeros(len(joints))).Jw_E[:, 0]
        self.p_RS = self.p_RJ[0] + axis * (axis @ (self.p_RJ[1] - self.p_RJ[0]))
        path = np.vstack([self.p_RS, self.p_RJ[1:]])
        self.reach_m = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _add_carriage(
    plant: MultibodyPlant, arm: ModelInstanceIndex, frame: Frame, visible: bool
) -> Frame:
    """Adds bodies that slide along x, y and z; returns the frame that carries the arm."""
    for axis, direction in zip("xyz", np.eye(3), strict=True):
        body = plant.AddRigidBody(
            f"base_{axis}", arm, SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(0.1))
        )
        plant.AddJoint(PrismaticJoint(f"base_{axis}", frame, body.body_frame(), direction))
        frame = body.body_frame()
    if visible and plant.geometry_source_is_registered():
        X_BV = RigidTransform(np.array([-0.1, 0.0, 0.0]))
        plant.RegisterVisualGeometry(body, X_BV, Box(0.2, 0.2, 0.02), "base_visual", _BASE_COLOR)
    return frame


def _hold_joints(
    plant: MultibodyPlant, arm: ModelInstanceIndex, positions: Mapping[str, float]
) -> None:
    """Replaces joints by welds, and frames of their names, at positions.

    `Joint.Lock` would neither work with an integrator's continuous plant nor save any time.
    """
    for actuator in map(plant.get_joint_actuator, plant.GetJointActuatorIndices()):
        if actuator.model_instance() == arm and actuator.joint().name() in positions:
            plant.RemoveJointActuator(actuator)
    for name, position in positions.items():
        joint = plant.GetJointByName(name, arm)
        if isinstance(joint, PrismaticJoint):
            X_PC = RigidTransform(position * joint.translation_axis())
        elif isinstance(joint, RevoluteJoint):
            X_PC = RigidTransform(RotationMatrix.MakeFromOneVector(joint.revolute_axis(), 2))
            turn = RigidTransform(RotationMatrix.MakeZRotation(position))
            X_PC = X_PC @ turn @ X_PC.inverse()
        else:
            raise ValueError(f"joint {name} is neither prismatic nor revolute")
        parent, child = joint.frame_on_parent(), joint.frame_on_child()
        plant.RemoveJoint(joint)
        plant.WeldFrames(plant.AddFrame(FixedOffsetFrame(name, parent, X_PC, arm)), child)
