"""The three-link planar arm of the 2-D testbed (paper V-A), read from models/planar_arm.urdf."""

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
from lic_drake.robots.arm import SkinCapsule, Vector
from lic_drake.robots.planar_kinematics import PlanarArmKinematics
from lic_drake.robots.skin_shape import SkinShape

LINK_NAMES = ("link1", "link2", "link3")

_MOVES = np.tri(3)
"""1 where a joint (column) moves a link (row)."""


class _Pose(NamedTuple):
    """Where the arm is at one configuration; see the methods of `PlanarArm` for the fields."""

    R_RL: Vector
    p_RL: Vector
    p_RE: Vector
    Jv_E: Vector


class PlanarArm:
    """Base welded at the world origin; joint impedance as implicit PD; satisfies `Arm`."""

    name = "planar-arm"
    link_names: tuple[str, ...] = LINK_NAMES
    surface: tuple[SkinShape, ...] | None = None

    def __init__(self) -> None:
        plant = MultibodyPlant(time_step=1e-3)
        scene_graph = SceneGraph()
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        arm = self.add_to_plant(plant)
        plant.Finalize()
        context = plant.CreateDefaultContext()

        joints = [plant.get_joint(index) for index in plant.GetJointIndices(arm)]
        joints = [joint for joint in joints if joint.num_positions() == 1]
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
        gains = [
            plant.get_joint_actuator(index).get_controller_gains()
            for index in plant.GetJointActuatorIndices(arm)
        ]
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
        (arm,) = Parser(plant).AddModels(str(models_dir() / "planar_arm.urdf"))
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


def _read_skin(plant: MultibodyPlant, scene_graph: SceneGraph, link: str) -> SkinCapsule:
    """Returns the capsule of a link as the description gives it."""
    inspector = scene_graph.model_inspector()
    (geometry,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link))
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
