"""Three-link planar arms: the one of the 2-D testbed (paper V-A), or any other description."""

import math
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Capsule, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, ModelInstanceIndex

from lic_drake.errors import ScenarioError
from lic_drake.paths import models_dir
from lic_drake.robots.arm import SkinCapsule
from lic_drake.robots.planar_kinematics import PlanarArmKinematics
from lic_drake.robots.skin_shape import SkinShape
from lic_drake.types import Vector

LINK_NAMES = ("link1", "link2", "link3")
"""Names of the links in a description, proximal to distal."""

_MOVES = np.tri(3)
"""1 where a joint (column) moves a link (row)."""


class _Pose(NamedTuple):
    """Where the arm is at one configuration; see the methods of `PlanarArm` for the fields."""

    R_RL: Vector
    p_RL: Vector
    p_RE: Vector
    Jv_E: Vector


class PlanarArm:
    """Base welded at the world origin; joint impedance as implicit PD; satisfies `Arm`.

    Attributes:
        name: Name in scenario files.
        kinematics: Its kinematics in closed form.
        damping: Joint damping of the impedance controller, shape (3,), Nms/rad.
    """

    link_names: tuple[str, ...] = LINK_NAMES
    surface: tuple[SkinShape, ...] | None = None

    torso_frame = ""

    def __init__(self, description: str | None = None, name: str = "planar-arm") -> None:
        """Reads an arm.

        Args:
            description: URDF text, by default that of models/planar_arm.urdf. As there, the links
                are base and link1 to link3, each of the latter with a collision capsule; three
                joints with limits turn about +z; at zero the arm points along -y from the origin
                of the base to the frame tip; each actuator has controller gains.
            name: Name in scenario files.

        Raises:
            ScenarioError: The description cannot be read or describes another kind of arm.
        """
        self.name = name
        self._description = description or (models_dir() / "planar_arm.urdf").read_text("utf-8")
        plant = MultibodyPlant(time_step=1e-3)
        scene_graph = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        try:
            self._read(plant, scene_graph)
        except (RuntimeError, ValueError) as error:
            raise ScenarioError(
                f"the description of {name} is not one of a planar arm: "
                f"{' '.join(str(error).split())}; models/planar_arm.urdf shows how it must be"
            ) from error

    def _read(self, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
        """Takes everything but the name from the description.

        Raises:
            RuntimeError: Drake cannot parse it, or misses something in it.
            ValueError: It is not a planar arm as this class knows it.
        """
        arm = self.add_to_plant(plant)
        plant.Finalize()
        context = plant.CreateDefaultContext()

        joints = [plant.get_joint(index) for index in plant.GetJointIndices(arm)]
        joints = [joint for joint in joints if joint.num_positions() == 1]
        if len(joints) != 3 or plant.num_positions() != 3:
            raise ValueError(f"it has {plant.num_positions()} degrees of freedom, not 3")
        tip = plant.GetFrameByName("tip", arm)
        frames = [joint.frame_on_parent() for joint in joints] + [tip]
        p_WJ = np.array([frame.CalcPoseInWorld(context).translation() for frame in frames])
        self.kinematics = PlanarArmKinematics(
            link_lengths=np.linalg.norm(np.diff(p_WJ, axis=0), axis=1),
            q_min=plant.GetPositionLowerLimits(),
            q_max=plant.GetPositionUpperLimits(),
        )
        self.q_min = self.kinematics.q_min
        self.q_max = self.kinematics.q_max
        self.p_RS = np.zeros(3)
        self.torso_m = 0.0
        self.reach_m = self.kinematics.reach_m
        if not np.all(np.isfinite([self.q_min, self.q_max])):
            raise ValueError("a joint has no limits")
        _check_kinematics(self.kinematics, plant, tip)
        actuators = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices(arm)]
        if len(actuators) != 3 or not all(a.has_controller() for a in actuators):
            raise ValueError("it needs three actuators with controller gains")
        gains = [actuator.get_controller_gains() for actuator in actuators]
        self.stiffness = np.array([gain.p for gain in gains])
        self.damping = np.array([gain.d for gain in gains])
        self.skin = tuple(_read_skin(plant, scene_graph, name) for name in LINK_NAMES)
        self._lengths = tuple(self.kinematics.link_lengths.tolist())
        # Sensor, controller and stop rules ask for the same configuration, one after the other.
        self._pose = lru_cache(maxsize=1)(self._calc_pose)

    def add_to_plant(
        self, plant: MultibodyPlant, parent: Frame | None = None
    ) -> ModelInstanceIndex:
        """Adds the arm without gravity, its base welded to a frame, else to the world's origin."""
        (arm,) = Parser(plant).AddModelsFromString(self._description, "urdf")
        plant.WeldFrames(parent or plant.world_frame(), plant.GetFrameByName("base", arm))
        plant.set_gravity_enabled(arm, False)
        return arm

    def raised(self, torso_m: float) -> "PlanarArm":
        """Returns the arm itself, which has no torso; raises a `ScenarioError` if that is not 0."""
        if torso_m != 0.0:
            raise ScenarioError(
                f"the planar arm has no torso; its torso_m must be 0, got {torso_m}"
            )
        return self

    def solve_ik(self, x0: Vector) -> Vector | None:
        """Returns q for x0 = (x, y, phi), or None; see `PlanarArmKinematics.solve_ik`."""
        return self.kinematics.solve_ik(x0)

    def start_angles(self, x0: Vector) -> Vector:
        """Returns q for x0 = (x, y, phi), shape (1, 3), or shape (0, 3) if there is none."""
        q = self.solve_ik(x0)
        return np.empty((0, 3)) if q is None else q[None]

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0 = (x, y, phi)."""
        return self.kinematics.tip_pose(q)

    def tip_position(self, q: Vector) -> Vector:
        """Returns p_RE, shape (3,), metres."""
        return self._pose(*q.tolist()).p_RE

    def tip_jacobian(self, q: Vector) -> Vector:
        """Returns Jv_v_RE, shape (3, 3), m/rad; the z row is zero."""
        return self._pose(*q.tolist()).Jv_E

    def link_poses(self, q: Vector) -> tuple[Vector, Vector]:
        """Returns R_RL, shape (3, 3, 3), and p_RL, shape (3, 3), metres."""
        pose = self._pose(*q.tolist())
        return pose.R_RL, pose.p_RL

    def point_jacobians(self, q: Vector, links: NDArray[np.intp], p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ of points on links, shape (n, 3, 3), m/rad."""
        p_JQ = p_RQ[:, None] - self._pose(*q.tolist()).p_RL
        jacobians = np.zeros((len(links), 3, 3))
        jacobians[:, 0] = -p_JQ[:, :, 1]
        jacobians[:, 1] = p_JQ[:, :, 0]
        jacobians *= _MOVES[links][:, None]
        return jacobians

    def _calc_pose(self, q1: float, q2: float, q3: float) -> _Pose:
        """Returns the arm's pose; its arrays are shared by all who ask, and so read-only."""
        l1, l2, l3 = self._lengths
        c1, s1 = math.cos(q1), math.sin(q1)
        c2, s2 = math.cos(q1 + q2), math.sin(q1 + q2)
        c3, s3 = math.cos(q1 + q2 + q3), math.sin(q1 + q2 + q3)
        # Second joint, third joint, tip: at q = 0 the links point along -y.
        x2, y2 = l1 * s1, -l1 * c1
        x3, y3 = x2 + l2 * s2, y2 - l2 * c2
        xE, yE = x3 + l3 * s3, y3 - l3 * c3
        pose = _Pose(
            R_RL=np.array(
                [
                    [[c1, -s1, 0.0], [s1, c1, 0.0], [0.0, 0.0, 1.0]],
                    [[c2, -s2, 0.0], [s2, c2, 0.0], [0.0, 0.0, 1.0]],
                    [[c3, -s3, 0.0], [s3, c3, 0.0], [0.0, 0.0, 1.0]],
                ]
            ),
            p_RL=np.array([[0.0, 0.0, 0.0], [x2, y2, 0.0], [x3, y3, 0.0]]),
            p_RE=np.array([xE, yE, 0.0]),
            Jv_E=np.array([[-yE, y2 - yE, y3 - yE], [xE, xE - x2, xE - x3], [0.0, 0.0, 0.0]]),
        )
        for item in pose:
            item.flags.writeable = False
        return pose


def _check_kinematics(kinematics: PlanarArmKinematics, plant: MultibodyPlant, tip: Frame) -> None:
    """Sees that an arm turns as the closed form has it.

    Raises:
        ValueError: It does not.
    """
    q = np.array([0.3, 0.7, 1.1])
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X_WE = tip.CalcPoseInWorld(context)
    x, y, phi = kinematics.tip_pose(q)
    direction = np.array([np.cos(phi), np.sin(phi), 0.0])
    if not (
        np.allclose(X_WE.translation(), [x, y, 0.0], atol=1e-6)
        and np.allclose(X_WE.rotation().matrix()[:, 0], direction, atol=1e-6)
    ):
        raise ValueError(
            f"at q = {q} rad its tip is at {np.round(X_WE.translation(), 4)} m with x along"
            f" {np.round(X_WE.rotation().matrix()[:, 0], 4)}, where joints about +z and links along"
            f" -y put it at [{x:.4f}, {y:.4f}, 0] with x along {np.round(direction, 4)}"
        )


def _read_skin(plant: MultibodyPlant, scene_graph: SceneGraph, link: str) -> SkinCapsule:
    """Returns the capsule of a link as the description gives it."""
    inspector = scene_graph.model_inspector()
    geometries = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link))
    if len(geometries) != 1:
        raise ValueError(f"{link}: the skin must be one capsule, found {len(geometries)} shapes")
    (geometry,) = geometries
    shape = inspector.GetShape(geometry)
    if not isinstance(shape, Capsule):
        raise ValueError(f"{link}: the skin must be a capsule, found {type(shape).__name__}")
    X_LC = inspector.GetPoseInFrame(geometry)
    return SkinCapsule(
        link=link,
        radius=shape.radius(),
        length=shape.length(),
        R_LC=X_LC.rotation().matrix(),
        p_LC=X_LC.translation(),
    )


@cache
def planar_arm() -> PlanarArm:
    """Returns the planar arm, read once a process."""
    return PlanarArm()
