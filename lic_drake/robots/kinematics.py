"""Kinematics of a serial arm from its model, numerical inverse kinematics included.

Frame R is the arm's base frame, which b0 carries; frame E is the tip, which points along Ex. A hand
pose x0 is (x, y, phi) for an arm in the plane, else position and quaternion (w, x, y, z) of E.
"""

from collections.abc import Sequence
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics, PositionCost
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, JacobianWrtVariable
from pydrake.solvers import SnoptSolver, SolverOptions

from lic_drake.types import BoolVector, Vector

if TYPE_CHECKING:
    from lic_drake.robots.arm import Arm

LIMIT_TOLERANCE = 1e-9
"""Joint angles this far beyond a limit, radians, are taken for rounding."""

IK_TOLERANCE = 1e-8
"""Largest error of a numerical inverse kinematics solution, metres and radians."""

# The solver begins in those of a pool of random configurations whose tip is nearest, where a turn
# of 1 rad counts as so many metres, until it has found enough or tried enough.
_POOL, _TURN_M, _ENOUGH, _MAX_TRIED = 1024, 0.3, 4, 16
_SNOPT: dict[str, float] = {"Major iterations limit": 50, "Major feasibility tolerance": 1e-9}
# From a plane this far behind the tip squares of distances are nearly linear, metres.
_FAR_M = 10.0
_DISTINCT_DIGITS = 5
# The tip, a point ahead of it and one beside it, and their bounds in the frame that E is to be in.
_INF = np.inf
_POINTS = np.array(
    [
        [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)],
        [(1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (_INF, 0.0, 0.0)],
        [(0.0, 1.0, 0.0), (-_INF, 0.0, 0.0), (_INF, _INF, 0.0)],
    ]
)
_X_R = np.array([1.0, 0.0, 0.0])

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
        self._plant, self._links, self._tip = plant, links, tip
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

        A redundant arm has infinitely many, of which these are local optima: those of lowest
        preselection cost first or, with `near`, the nearest one. A quaternion may have any positive
        norm.
        """
        p_RE, R_RE = rigid_pose(x0)
        return self._solve(RigidTransform(RotationMatrix(R_RE), p_RE), len(_POINTS), near)

    def solve_pointing(self, p_RE: Vector, u_R: Vector) -> list[Vector]:
        """Returns configurations with the tip at each of k places, pointing along u_R.

        For each place those within the limits, shape (n, m), lowest preselection cost first.
        """
        R_RE = RotationMatrix.MakeFromOneVector(u_R, 0)
        return [self._solve(RigidTransform(R_RE, p), len(_POINTS) - 1) for p in p_RE]

    def calc_preselection_cost(self, q: Vector) -> Vector:
        """Returns the cost of Eq. (5) of configurations, shape (n, m), as shape (n,), 1/m.

        C = 1 / (|x'p_tw| + |x'p_te|) with p_tw and p_te from the tool to wrist and elbow, here the
        origins of the last and the middle link: low where hand and forearm point into the clutter.
        """
        behind = np.empty(len(q))
        for i, row in enumerate(q):
            pose = self.calc_pose(row)
            wrist, elbow = pose.p_RL[-1], pose.p_RL[len(pose.p_RL) // 2]
            behind[i] = abs(pose.p_RE[0] - wrist[0]) + abs(pose.p_RE[0] - elbow[0])
        return 1.0 / np.maximum(behind, 1e-9)

    def _solve(self, X_RE: RigidTransform, points: int, near: Vector | None = None) -> Vector:
        """Returns the distinct optima that Drake's inverse kinematics find, shape (n, m).

        `points` of the hand are where the pose has them: all, or without the one that fixes its
        roll. The cost is Eq. (5), by wrist and elbow behind the tip, or the distance from `near`.
        """
        ik = InverseKinematics(self._plant, self._context, with_joint_limits=False)
        program, q, world = ik.get_mutable_prog(), ik.q(), self._plant.world_frame()
        program.AddBoundingBoxConstraint(self.q_min, self.q_max, q)
        for p_EQ, low, high in _POINTS[:points]:
            ik.AddPositionConstraint(
                frameB=self._tip,
                p_BQ=p_EQ,
                frameAbar=world,
                X_AbarA=X_RE,
                p_AQ_lower=low,
                p_AQ_upper=high,
            )
        if near is None:
            p_RF, C = X_RE.translation() - _FAR_M * _X_R, np.diag([0.5 / _FAR_M, 0.0, 0.0])
            for link in (self._links[-1], self._links[len(self._links) // 2]):
                cost = PositionCost(self._plant, world, p_RF, link, np.zeros(3), C, self._context)
                program.AddCost(cost, q)
            seeds = self._seeds(X_RE, points)
        else:
            program.AddQuadraticErrorCost(1.0, near, q)
            seeds = near[None]
        solver, options = SnoptSolver(), SolverOptions()
        for name, value in _SNOPT.items():
            options.SetOption(solver.id(), name, value)
        constraints = program.GetAllConstraints()
        ends = (solver.Solve(program, seed, options).get_x_val() for seed in seeds)
        kept = (x for x in ends if program.CheckSatisfied(constraints, x, IK_TOLERANCE))
        found = np.array(list(islice(kept, _ENOUGH))).reshape(-1, len(q))
        found = np.clip(found, self.q_min, self.q_max)
        _, first = np.unique(np.round(found, _DISTINCT_DIGITS), axis=0, return_index=True)
        found = found[first]
        return found[np.argsort(self.calc_preselection_cost(found), kind="stable")]

    def _seeds(self, X_RE: RigidTransform, points: int) -> Vector:
        """Returns where to begin, shape (n, m)."""
        pool, p_RE, R_RE = self._pool
        axes = slice(points - 1)  # With a free roll only Ex counts.
        turn = np.linalg.norm((R_RE - X_RE.rotation().matrix())[:, :, axes], axis=(1, 2))
        apart = np.linalg.norm(p_RE - X_RE.translation(), axis=1) + _TURN_M * turn
        return pool[np.argsort(apart, kind="stable")[:_MAX_TRIED]]

    @cached_property
    def _pool(self) -> tuple[Vector, Vector, Vector]:
        """Random configurations, shape (n, m), with positions and rotations of their tips."""
        shape = (_POOL, len(self.q_min))
        pool = np.random.default_rng(0).uniform(self.q_min, self.q_max, shape)
        poses = [self.calc_pose(q) for q in pool]
        return pool, np.array([x.p_RE for x in poses]), np.array([x.R_RE for x in poses])


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
