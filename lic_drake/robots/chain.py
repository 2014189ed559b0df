"""`Chain`: a serial arm in product-of-exponentials form, for many configurations at once.

Numerical inverse kinematics starts from many random configurations. One by one through a plant they
cost a hundred times as much as together in NumPy.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from lic_drake.types import BoolVector, IntVector, Vector

IK_TOLERANCE = 1e-10
"""Largest error of a numerical inverse kinematics solution, metres and radians."""

_MAX_NEWTON_STEPS = 40
_LARGEST_STEP = 0.5
_DAMPING = 1e-8
_DISTINCT_RAD = 1e-5
# Steps along the self-motion: how many, radians per metre of gain, and the largest, radians.
_SELF_MOTION_STEPS = 25
_SELF_MOTION_GAIN = 3.0
_SELF_MOTION_RAD = 0.25


class ChainPose(NamedTuple):
    """The arm at n configurations of m joints, in R.

    Attributes:
        p_RE: Position of the tip, shape (n, 3), metres.
        R_RE: Rotation of the tip frame, shape (n, 3, 3).
        Jv_E: Translational Jacobian of the tip, shape (n, 3, m), m/rad.
        Jw_E: Angular Jacobian of the tip, the joint axes, shape (n, 3, m).
        behind: |x'p_tw| + |x'p_te| of Eq. (5), shape (n,), metres.
        J_behind: Its gradient, shape (n, m), m/rad.
    """

    p_RE: Vector
    R_RE: Vector
    Jv_E: Vector
    Jw_E: Vector
    behind: Vector
    J_behind: Vector


type Missing = Callable[[ChainPose, IntVector], tuple[Vector, Vector]]
"""Gives what is left to each row's goal, by its index: shape (n, r), and Jacobian (n, r, m)."""


@dataclass(frozen=True)
class Chain:
    """A serial arm at q = 0, in R.

    Attributes:
        axes: Joint axes, shape (m, 3).
        p_RJ: A point on each axis, and the tip, shape (m + 1, 3), metres.
        R_RE: Rotation of the tip frame, shape (3, 3).
        marks: Wrist and elbow of Eq. (5): by how many joints each is moved, and its position.
        q_min: Lower joint limits, shape (m,), radians.
        q_max: Upper joint limits, shape (m,), radians.
    """

    axes: Vector
    p_RJ: Vector
    R_RE: Vector
    marks: tuple[tuple[int, Vector], ...]
    q_min: Vector
    q_max: Vector

    @cached_property
    def _cross(self) -> Vector:
        """Cross product matrices of the axes, shape (m, 3, 3)."""
        return -np.cross(self.axes[:, None], np.eye(3))

    def calc_pose(self, q: Vector) -> ChainPose:
        """Returns the arm's pose at configurations, shape (n, m), radians."""
        n, m = q.shape
        s, c = np.sin(q)[..., None, None], np.cos(q)[..., None, None]
        turns = np.eye(3) + s * self._cross + (1.0 - c) * (self._cross @ self._cross)
        # R[k] and p[k]: where joint k has moved what was at the identity, and its own origin.
        R = np.empty((m + 1, n, 3, 3))
        p, axes = np.empty((m + 1, n, 3)), np.empty((n, 3, m))
        R[0], p[0] = np.eye(3), self.p_RJ[0]
        for i in range(m):
            axes[:, :, i] = R[i] @ self.axes[i]
            R[i + 1] = R[i] @ turns[:, i]
            p[i + 1] = p[i] + R[i + 1] @ (self.p_RJ[i + 1] - self.p_RJ[i])
        p_RE, joints = p[m], np.moveaxis(p[:m], 0, 2)
        Jv_E = np.cross(axes, p_RE[:, :, None] - joints, axis=1)
        behind, J_behind = np.zeros(n), np.zeros((n, m))
        for moved, at_zero in self.marks:
            last = max(moved, 1) - 1
            p_RM = p[last] + R[moved] @ (at_zero - self.p_RJ[last])
            J = np.cross(axes, p_RM[:, :, None] - joints, axis=1)[:, 0]
            J[:, moved:] = 0.0
            apart = p_RE[:, 0] - p_RM[:, 0]
            behind += np.abs(apart)
            J_behind += np.sign(apart)[:, None] * (Jv_E[:, 0] - J)
        return ChainPose(p_RE, R[m] @ self.R_RE, Jv_E, axes, behind, J_behind)

    def to_pose(self, p_RE: Vector, R_RE: Vector, rows: list[int]) -> Missing:
        """Returns what is missing to one tip pose, in some rows of position and rotation vector."""

        def missing(pose: ChainPose, which: IntVector) -> tuple[Vector, Vector]:
            turn = Rotation.from_matrix(R_RE @ pose.R_RE.transpose(0, 2, 1)).as_rotvec()
            error = np.hstack([p_RE - pose.p_RE, turn])
            return error[:, rows], np.concatenate([pose.Jv_E, pose.Jw_E], axis=1)[:, rows]

        return missing

    def to_pointing(self, p_RE: Vector, u_R: Vector) -> Missing:
        """Returns what is missing to tips at k places, shape (k, 3), where Ex points along u_R."""

        def missing(pose: ChainPose, which: IntVector) -> tuple[Vector, Vector]:
            u = pose.R_RE[:, :, 0]
            axis, cos = np.cross(u, u_R), u @ u_R
            sin = np.linalg.norm(axis, axis=1)
            turn = (np.arctan2(sin, cos) / np.maximum(sin, 1e-12))[:, None] * axis
            turn += (cos < -0.999)[:, None] * pose.R_RE[:, :, 2]
            across = pose.Jw_E - u[:, :, None] * (u[:, None] @ pose.Jw_E)
            error = np.hstack([p_RE[which] - pose.p_RE, turn])
            return error, np.concatenate([pose.Jv_E, across], axis=1)

        return missing

    def solve(self, missing: Missing, seeds: Vector, num_goals: int = 1) -> list[Vector]:
        """Returns distinct solutions within the limits for each goal, shape (n, m).

        Those that Newton steps from the seeds come to, and those to which Eq. (5) leads from there
        along the self-motion of a redundant arm.
        """
        which = np.repeat(np.arange(num_goals), len(seeds))
        found, which = self.newton(missing, np.tile(seeds, (num_goals, 1)), which)
        q = found
        for _ in range(_SELF_MOTION_STEPS if len(q) else 0):
            pose = self.calc_pose(q)
            error, J = missing(pose, which)
            q = self._step(q, J, error, pose.J_behind)
        best, of_best = self.newton(missing, q, which)
        found, which = np.vstack([found, best]), np.append(which, of_best)
        return [_distinct(found[which == goal]) for goal in range(num_goals)]

    def newton(
        self, missing: Missing, q: Vector, which: IntVector | None = None
    ) -> tuple[Vector, IntVector]:
        """Returns solutions that damped Newton steps within the limits come to, and their goals.

        `which` goal each row of q is for: by default the only one.
        """
        which = np.zeros(len(q), dtype=int) if which is None else which
        found, active = np.full(q.shape, np.nan), np.arange(len(q))
        for _ in range(_MAX_NEWTON_STEPS):
            if len(active) == 0:
                break
            error, J = missing(self.calc_pose(q), which[active])
            done = np.abs(error).max(axis=1) < IK_TOLERANCE
            found[active[done]] = q[done]
            active, q = active[~done], self._step(q[~done], J[~done], error[~done])
        solved = ~np.isnan(found[:, 0])
        return found[solved], which[solved]

    def _step(self, q: Vector, J: Vector, error: Vector, uphill: Vector | None = None) -> Vector:
        """Returns configurations after a step towards the goal and, along the self-motion, uphill.

        Joints that a step would take beyond a limit stand still in a second try.
        """
        free: BoolVector = np.ones(q.shape, dtype=bool)
        for _ in range(2):
            Jf = J * free[:, None]
            JT = Jf.transpose(0, 2, 1)
            inverse = JT @ np.linalg.inv(Jf @ JT + _DAMPING * np.eye(J.shape[1]))
            step = (inverse @ error[..., None])[..., 0]
            if uphill is not None:
                along = free * uphill
                along = _SELF_MOTION_GAIN * (along - (inverse @ (Jf @ along[..., None]))[..., 0])
                step += _shortened(along, _SELF_MOTION_RAD)
            beyond = ((q <= self.q_min) & (step < 0.0)) | ((q >= self.q_max) & (step > 0.0))
            if not np.any(beyond):
                break
            free &= ~beyond
        return np.clip(q + _shortened(step, _LARGEST_STEP), self.q_min, self.q_max)


def _shortened(step: Vector, largest: float) -> Vector:
    """Returns steps, shape (n, m), of which no component exceeds a length."""
    size = np.abs(step).max(axis=1, keepdims=True)
    shortened: Vector = step * np.minimum(1.0, largest / np.maximum(size, 1e-12))
    return shortened


def _distinct(q: Vector) -> Vector:
    """Returns the rows that no earlier one is equal to."""
    apart = np.abs(q[:, None] - q[None]).max(axis=2, initial=0.0)
    return q[~np.any(np.tril(apart <= _DISTINCT_RAD, -1), axis=1)]
