"""The right arm of a PR2 whose base and torso stand still for the reach (paper IV-B, V)."""

from collections.abc import Sequence
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, ModelInstanceIndex

from lic_drake.errors import ScenarioError
from lic_drake.robots.pr2_description import (
    BASE_JOINTS,
    LEFT_ARM_AT_REST,
    SOFT_LIMITS,
    TORSO_JOINT,
    TORSO_RANGE_M,
    add_pr2,
    joint_names,
    link_names,
    read_pr2,
    weld_joints,
)
from lic_drake.robots.pr2_inverse import calc_preselection_cost, solve_pose
from lic_drake.robots.pr2_kinematics import Pr2Kinematics, calc_point_jacobians
from lic_drake.types import Vector

MPC_LIMITS_DEG = np.array(
    [
        [-109.0, 26.0],
        [-24.0, 68.0],
        [-220.0, 41.0],
        [-132.0, 0.0],
        [-270.0, 270.0],
        [-120.0, 0.0],
        [-180.0, 180.0],
    ]
)
"""Joint limits of the controller (gt-ros-pkg/hrl-haptic-manip, facts only), mirrored to the right.

They stop joints that could turn for ever, so that cables and a reach have an end.
"""

HOME_DEG = np.array([-40.0, 20.0, -90.0, -90.0, 0.0, -45.0, 0.0])
"""A posture of ours: elbow out to the side, hand before the body, nothing near a limit."""


class Pr2Arm:
    """Base and torso welded, joint impedance as implicit PD, gravity off; satisfies `Arm`.

    Frame R is the frame to which the robot is added, on the floor: base_footprint if the base
    pose is 0. Hand poses x0 are the tool frame's position and quaternion (w, x, y, z), shape (7,).

    Args:
        base_pose: Where the base stands in R: x, y (metres) and heading (radians).
        torso_m: Height of the torso lift, metres.
        mobile: Whether base and torso keep their joints in a plant, for a robot that moves between
            reaches or looks for a place to reach from; nothing drives them.

    Raises:
        ScenarioError: The torso cannot go there.
    """

    name = "pr2"
    torso_frame = TORSO_JOINT
    link_names: tuple[str, ...] = link_names()

    def __init__(
        self,
        base_pose: Sequence[float] = (0.0, 0.0, 0.0),
        torso_m: float = TORSO_RANGE_M[0],
        mobile: bool = False,
    ) -> None:
        if not TORSO_RANGE_M[0] <= torso_m <= TORSO_RANGE_M[1]:
            raise ScenarioError(
                "the PR2's torso_m must be from {} to {}, got {}".format(*TORSO_RANGE_M, torso_m)
            )
        x, y, theta = (float(value) for value in base_pose)
        self.base_pose = (x, y, theta)
        self.torso_m = torso_m
        self.mobile = mobile
        pr2 = read_pr2()
        mpc_min, mpc_max = np.deg2rad(MPC_LIMITS_DEG).T
        self.q_min: Vector = np.maximum(mpc_min, pr2.q_min)
        self.q_max: Vector = np.minimum(mpc_max, pr2.q_max)
        self.q_soft_min, self.q_soft_max = np.array(SOFT_LIMITS).T
        self.q_home: Vector = np.deg2rad(HOME_DEG)
        self.stiffness = pr2.stiffness
        self.damping = pr2.damping
        self.effort_limit = pr2.effort_limit
        self.velocity_limit = pr2.velocity_limit
        self.surface = pr2.surface
        self.skin = tuple(shape.enclosing_capsule() for shape in pr2.surface)
        p_RA = RotationMatrix.MakeZRotation(theta).matrix() @ pr2.p_FA + [x, y, torso_m]
        self.kinematics = Pr2Kinematics(
            yaw=theta, p_RA=p_RA, lengths=pr2.lengths, q_min=self.q_min, q_max=self.q_max
        )
        self.p_RS = p_RA
        self.reach_m = self.kinematics.reach_m
        # Sensor, controller and stop rules ask for the same configuration, one after the other.
        self._pose = lru_cache(maxsize=1)(self.kinematics.calc_pose)

    def add_to_plant(
        self, plant: MultibodyPlant, parent: Frame | None = None
    ) -> ModelInstanceIndex:
        """Adds the robot without gravity, its floor frame R welded to a frame, else to the world.

        Args:
            plant: The plant, not yet finalized.
            parent: The frame that becomes R.
        """
        pr2 = add_pr2(plant)
        root = plant.GetFrameByName("base_link_for_rbt_compat", pr2)
        plant.WeldFrames(parent or plant.world_frame(), root)
        stand = dict(zip((*BASE_JOINTS, TORSO_JOINT), (*self.base_pose, self.torso_m), strict=True))
        rest = dict(zip(joint_names("l"), LEFT_ARM_AT_REST, strict=True))
        if self.mobile:
            for name, position in stand.items():
                plant.GetJointByName(name, pr2).set_default_positions(np.array([position]))
            weld_joints(plant, pr2, rest)
        else:
            weld_joints(plant, pr2, stand | rest)
        return pr2

    def raised(self, torso_m: float) -> "Pr2Arm":
        """Returns the arm of a robot that stands in the same place with its torso at a height.

        Raises:
            ScenarioError: The torso cannot go there.
        """
        return _standing(self.base_pose, torso_m)

    def solve_ik(self, x0: Vector) -> Vector | None:
        """Returns the configuration of least cost (Eq. 5) that brings the tool to x0, or None.

        It may collide with the robot: `start_angles` gives all of them to choose from.

        Args:
            x0: Position and quaternion of the tool frame, shape (7,); of any positive norm.
        """
        q = self.start_angles(x0)
        return q[0] if len(q) else None

    def start_angles(self, x0: Vector) -> Vector:
        """Returns the configurations that bring the tool to x0, shape (n, 7), by Eq. (5).

        Args:
            x0: As for `solve_ik`.
        """
        R_RE = RotationMatrix(Quaternion(x0[3:] / np.linalg.norm(x0[3:]))).matrix()
        q = solve_pose(self.kinematics, x0[:3], R_RE)
        cost = calc_preselection_cost(self.kinematics, q)
        sorted_q: Vector = q[np.argsort(cost, kind="stable")]
        return sorted_q

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0: p_RE and the quaternion of R_RE with w >= 0, shape (7,)."""
        pose = self._pose(*q.tolist())
        wxyz = RotationMatrix(pose.R_RL[6]).ToQuaternion().wxyz()
        return np.concatenate((pose.p_RE, wxyz if wxyz[0] >= 0.0 else -wxyz))

    def tip_position(self, q: Vector) -> Vector:
        """Returns p_RE, shape (3,), metres."""
        return self._pose(*q.tolist()).p_RE

    def tip_rotation(self, q: Vector) -> Vector:
        """Returns R_RE, shape (3, 3); the tool points along its first column."""
        R_RE: Vector = self._pose(*q.tolist()).R_RL[6]
        return R_RE

    def tip_jacobian(self, q: Vector) -> Vector:
        """Returns Jv_v_RE, shape (3, 7), m/rad."""
        return self._pose(*q.tolist()).Jv_E

    def tip_angular_jacobian(self, q: Vector) -> Vector:
        """Returns Jv_w_RE, shape (3, 7)."""
        return self._pose(*q.tolist()).Jw_E

    def link_poses(self, q: Vector) -> tuple[Vector, Vector]:
        """Returns R_RL, shape (7, 3, 3), and p_RL, shape (7, 3), metres."""
        pose = self._pose(*q.tolist())
        return pose.R_RL, pose.p_RL

    def point_jacobians(self, q: Vector, links: NDArray[np.intp], p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ of points on links, shape (n, 3, 7), m/rad."""
        return calc_point_jacobians(self._pose(*q.tolist()), links, p_RQ)


@cache
def pr2_arm() -> Pr2Arm:
    """Returns the arm of a robot that stands at the origin, its torso down; made once a process."""
    return Pr2Arm()


@lru_cache(maxsize=64)
def _standing(base_pose: tuple[float, float, float], torso_m: float) -> Pr2Arm:
    return Pr2Arm(base_pose, torso_m)
