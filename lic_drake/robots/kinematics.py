"""Kinematics of a serial arm from its model, numerical inverse kinematics included.

Frame R is the arm's base frame, which b0 carries; frame E is the tip, which points along Ex. A hand
pose x0 is (x, y, phi) for an arm in the plane, else position and quaternion (w, x, y, z) of E.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, JacobianWrtVariable

from lic_drake.robots.chain import Chain
from lic_drake.types import BoolVector, Vector

if TYPE_CHECKING:
    from lic_drake.robots.arm import Arm

LIMIT_TOLERANCE = 1e-9
"""Joint angles this far beyond a limit, radians, are taken for rounding."""

_NUM_SEEDS = 32

_PERMUTATION = np.array(
    [
        *([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]),
        *([0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        *([0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ]
)
"""Entry (3 i + k, l) is the sign of the permutation (k, l, i), else 0."""


class ArmPose(NamedTuple):
    """Where the arm is at one configuration of m joints; all arrays are read-only.

    Attributes:
        R_RL: Rotations of the k skin links, shape (k, 3, 3).
        p_RL: Their origins, shape (k, 3), metres.
        p_RE: Position of the tip, shape (3,), metres.
        R_RE: Rotation of the tip frame, shape (3, 3).
        Jv_E: Translational Jacobian of the tip, shape (3, m), m/rad.
        Jw_E: Angular Jacobian of the tip, the joint axes, shape (3, m).
        turn: Matrix, shape (3, 3 m), with p_RQ @ turn = the axes' cross products with p_RQ.
        moment: The cross products of each axis with a point on it, shape (3, m), metres.
    """

    R_RL: Vector
    p_RL: Vector
    p_RE: Vector
    R_RE: Vector
    Jv_E: Vector
    Jw_E: Vector
    turn: Vector
    moment: Vector


def cross_matrix(axes: Vector) -> Vector:
    """Returns `ArmPose.turn` of joint axes, shape (3, m)."""
    turn: Vector = (_PERMUTATION @ axes).reshape(3, -1)
    return turn


def wrap_angle(angle: float) -> float:
    """Returns the angle wrapped to [-pi, pi), radians."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


class Kinematics:
    """Kinematics of an arm from its model; subclasses override what they know in closed form.

    Args:
        arm: The arm, of which limits and joints are known.
        plant: A plant with the arm alone, whose positions are q and whose world frame is R.
        links: Frames of the skin links.
        tip: Frame E.
    """

    def __init__(
        self, arm: "Arm", plant: MultibodyPlant, links: Sequence[Frame], tip: Frame
    ) -> None:
        self.is_planar = arm.is_planar
        self.q_min, self.q_max = arm.q_min, arm.q_max
        self._arm, self._plant, self._links, self._tip = arm, plant, links, tip
        self._context = plant.CreateDefaultContext()

    def calc_pose(self, q: Vector) -> ArmPose:
        """Returns the arm's pose at joint angles q, shape (m,), radians."""
        plant, context, world = self._plant, self._context, self._plant.world_frame()
        plant.SetPositions(context, q)
        X_RL = [link.CalcPoseInWorld(context) for link in self._links]
        X_RE = self._tip.CalcPoseInWorld(context)
        J = plant.CalcJacobianSpatialVelocity(
            context, JacobianWrtVariable.kV, self._tip, np.zeros(3), world, world
        )
        p_RE, Jw_E, Jv_E = X_RE.translation(), J[:3], J[3:]
        turn = cross_matrix(Jw_E)
        return frozen(
            ArmPose(
                R_RL=np.array([X.rotation().matrix() for X in X_RL]),
                p_RL=np.array([X.translation() for X in X_RL]),
                p_RE=p_RE,
                R_RE=X_RE.rotation().matrix(),
                Jv_E=Jv_E,
                Jw_E=Jw_E,
                turn=turn,
                moment=(p_RE @ turn).reshape(3, -1) - Jv_E,
            )
        )

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0: (x, y, phi) with phi in [-pi, pi), or p_RE and quaternion with w >= 0."""
        pose = self.calc_pose(q)
        if self.is_planar:
            return np.array([*pose.p_RE[:2], np.arctan2(pose.R_RE[1, 0], pose.R_RE[0, 0])])
        wxyz = RotationMatrix(pose.R_RE).ToQuaternion().wxyz()
        return np.concatenate((pose.p_RE, wxyz if wxyz[0] >= 0.0 else -wxyz))

    def solve_ik(self, x0: Vector, near: Vector | None = None) -> Vector:
        """Returns configurations within the joint limits for a hand pose in R, shape (n, m).

        A redundant arm has infinitely many, of which this is a sample: those of lowest preselection
        cost first or, with `near`, the nearest first. A quaternion may have any positive norm.
        """
        missing = self.chain.to_pose(*rigid_pose(x0), [0, 1, 5] if self.is_planar else [*range(6)])
        if near is None:
            return self._cheapest_first(*self.chain.solve(missing, self._seeds))
        found, _ = self.chain.newton(missing, np.vstack([near, 0.5 * (near + self._seeds[:8])]))
        return found[np.argsort(np.linalg.norm(found - near, axis=1), kind="stable")]

    def solve_pointing(self, p_RE: Vector, u_R: Vector) -> list[Vector]:
        """Returns configurations with the tip at each of k places, pointing along u_R.

        For each place those within the limits, shape (n, m), lowest preselection cost first.
        """
        if self.is_planar:
            phi = np.arctan2(u_R[1], u_R[0])
            return [self.solve_ik(np.array([*p[:2], phi])) for p in p_RE]
        missing = self.chain.to_pointing(p_RE, u_R)
        found = self.chain.solve(missing, self._seeds, len(p_RE))
        return [self._cheapest_first(q) for q in found]

    def calc_preselection_cost(self, q: Vector) -> Vector:
        """Returns the cost of Eq. (5) of configurations, shape (n, m), as shape (n,), 1/m.

        C = 1 / (|x'p_tw| + |x'p_te|) with p_tw and p_te from the tool to wrist and elbow, here the
        origins of the last and the middle link: low where hand and forearm point into the clutter.
        """
        return 1.0 / np.maximum(self.chain.calc_pose(q).behind, 1e-9)

    def _cheapest_first(self, q: Vector) -> Vector:
        return q[np.argsort(self.calc_preselection_cost(q), kind="stable")]

    @cached_property
    def _seeds(self) -> Vector:
        shape = (_NUM_SEEDS, len(self.q_min))
        return np.random.default_rng(0).uniform(self.q_min, self.q_max, shape)

    @cached_property
    def chain(self) -> Chain:
        """The arm for many configurations at once."""
        pose, arm = self.calc_pose(np.zeros(len(self.q_min))), self._arm
        marks = (len(pose.p_RL) - 1, len(pose.p_RL) // 2)
        return Chain(
            axes=pose.Jw_E.T,
            p_RJ=arm.p_RJ,
            R_RE=pose.R_RE,
            marks=tuple((arm.num_moving(link), pose.p_RL[link]) for link in marks),
            q_min=self.q_min,
            q_max=self.q_max,
        )


def frozen(pose: ArmPose) -> ArmPose:
    """Makes the arrays of a pose read-only, because all who ask for it share them."""
    for array in pose:
        array.flags.writeable = False
    return pose


def rigid_pose(x0: Vector) -> tuple[Vector, Vector]:
    """Returns position, shape (3,), and rotation matrix, shape (3, 3), of a hand pose."""
    if len(x0) == 3:
        R = RotationMatrix.MakeZRotation(float(x0[2]))
        return np.array([x0[0], x0[1], 0.0]), R.matrix()
    return x0[:3], RotationMatrix(Quaternion(x0[3:] / np.linalg.norm(x0[3:]))).matrix()


def keep_limits(q: Vector, q_min: Vector, q_max: Vector) -> tuple[Vector, BoolVector]:
    """Returns the rows of q, shape (n, m), within the limits, and a mask of them, shape (n,).

    What is beyond a limit by rounding is set to it.
    """
    legal = np.all((q >= q_min - LIMIT_TOLERANCE) & (q <= q_max + LIMIT_TOLERANCE), axis=1)
    return np.clip(q[legal], q_min, q_max), legal
