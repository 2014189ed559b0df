"""The three-link planar arm of the 2-D testbed (paper V-A), read from models/planar_arm.urdf."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Capsule, SceneGraph
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

from lic_drake.paths import models_dir
from lic_drake.robots.arm import SkinCapsule, Vector
from lic_drake.robots.planar_kinematics import PlanarArmKinematics

LINK_NAMES = ("link1", "link2", "link3")


class PlanarArm:
    """Base welded at the world origin; joint impedance as implicit PD; satisfies `Arm`."""

    name = "planar-arm"
    link_names: tuple[str, ...] = LINK_NAMES

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
        self.reach_m = self.kinematics.reach_m
        gains = [
            plant.get_joint_actuator(index).get_controller_gains()
            for index in plant.GetJointActuatorIndices(arm)
        ]
        self.stiffness = np.array([gain.p for gain in gains])
        self.damping = np.array([gain.d for gain in gains])
        self.skin = tuple(_read_skin(plant, scene_graph, name) for name in LINK_NAMES)

    def add_to_plant(self, plant: MultibodyPlant) -> ModelInstanceIndex:
        """Adds the arm, welded to the world at the origin, without gravity."""
        (arm,) = Parser(plant).AddModels(str(models_dir() / "planar_arm.urdf"))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base", arm))
        plant.set_gravity_enabled(arm, False)
        return arm

    def solve_ik(self, x0: Vector) -> Vector | None:
        """Returns q for x0 = (x, y, phi), or None; see `PlanarArmKinematics.solve_ik`."""
        return self.kinematics.solve_ik(x0)

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0 = (x, y, phi)."""
        return self.kinematics.tip_pose(q)

    def tip_position(self, q: Vector) -> Vector:
        """Returns p_RE, shape (3,), metres."""
        return np.append(self.kinematics.link_origins(q)[-1], 0.0)

    def tip_jacobian(self, q: Vector) -> Vector:
        """Returns Jv_v_RE, shape (3, 3), m/rad; the z row is zero."""
        return np.vstack([self.kinematics.tip_pose_jacobian(q)[:2], np.zeros(3)])

    def link_poses(self, q: Vector) -> tuple[Vector, Vector]:
        """Returns R_RL, shape (3, 3, 3), and p_RL, shape (3, 3), metres."""
        angles = np.cumsum(q)
        cos, sin = np.cos(angles), np.sin(angles)
        R_RL = np.zeros((3, 3, 3))
        R_RL[:, 0, 0], R_RL[:, 0, 1] = cos, -sin
        R_RL[:, 1, 0], R_RL[:, 1, 1] = sin, cos
        R_RL[:, 2, 2] = 1.0
        origins = self.kinematics.link_origins(q)[:3]
        return R_RL, np.column_stack([origins, np.zeros(3)])

    def point_jacobians(self, q: Vector, links: NDArray[np.intp], p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ of points on links, shape (n, 3, 3), m/rad."""
        p_JQ = p_RQ[:, None, :2] - self.kinematics.link_origins(q)[None, :3]
        moves = np.arange(3)[None, :] <= links[:, None]
        jacobians = np.zeros((len(links), 3, 3))
        jacobians[:, 0] = np.where(moves, -p_JQ[:, :, 1], 0.0)
        jacobians[:, 1] = np.where(moves, p_JQ[:, :, 0], 0.0)
        return jacobians


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
