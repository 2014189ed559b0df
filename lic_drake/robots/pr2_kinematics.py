"""Forward kinematics of the PR2's right arm, without Drake: it runs in the control loop.

Frame R is where the robot is added to the world; base, torso and arm place the tool frame E in it.
From the pan axis on the seven joints turn about z, y, x, y, x, y and x of the link they carry, and
all offsets lie along x: pan axis to shoulder, shoulder to elbow, elbow to wrist, wrist to tool. At
q = 0 the arm is straight.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector

_Axis = tuple[float, float, float]

_ZEROS = (0.0,) * 7

_MOVES = np.tri(7)
"""1 where a joint (column) moves a link (row)."""


class ArmLengths(NamedTuple):
    """Distances along the arm, metres."""

    shoulder: float
    upper_arm: float
    forearm: float
    tool: float


class Pr2Pose(NamedTuple):
    """Where the arm is at one configuration, with what its Jacobians are made of.

    Attributes:
        R_RL: Rotations of the seven links, shape (7, 3, 3); the last one is also R_RE.
        p_RL: Their origins, shape (7, 3), metres.
        p_RE: Position of the tool frame, shape (3,), metres.
        Jv_E: Translational Jacobian of the tool frame's origin, shape (3, 7), m/rad.
        Jw_E: Angular Jacobian, the joint axes, shape (3, 7).
        turn: Matrix, shape (3, 21), with p_RQ @ turn = the axes' cross products with p_RQ.
        moment: The same for a point of each axis itself, shape (3, 7), metres.
    """

    R_RL: Vector
    p_RL: Vector
    p_RE: Vector
    Jv_E: Vector
    Jw_E: Vector
    turn: Vector
    moment: Vector


@dataclass(frozen=True, kw_only=True)
class Pr2Kinematics:
    """Lengths and joint limits of the arm, and where its base stands.

    Attributes:
        yaw: Heading of the base in R, radians.
        p_RA: Position of the pan axis at the height of the arm, shape (3,), metres.
        lengths: Distances along the arm.
        q_min: Lower joint limits, shape (7,), radians.
        q_max: Upper joint limits, shape (7,), radians.
    """

    yaw: float
    p_RA: Vector
    lengths: ArmLengths
    q_min: Vector
    q_max: Vector

    @cached_property
    def reach_m(self) -> float:
        """Bound of the tip's distance from the pan axis: the straight arm."""
        return sum(self.lengths)

    def within_limits(self, q: Vector, tolerance: float = 1e-9) -> bool:
        """Tells whether q keeps all joint limits, to a tolerance in radians."""
        return bool(np.all(q >= self.q_min - tolerance) and np.all(q <= self.q_max + tolerance))

    def calc_pose(self, *q: float) -> Pr2Pose:
        """Returns the arm's pose at seven joint angles, radians.

        Scalars, because numpy takes longer to start than these few numbers need.
        """
        pan, lift, upper_arm_roll, elbow, forearm_roll, wrist, wrist_roll = q
        shoulder_m, upper_arm_m, forearm_m, tool_m = self.lengths
        heading = self.yaw + pan
        x1: _Axis = (math.cos(heading), math.sin(heading), 0.0)
        y1: _Axis = (-x1[1], x1[0], 0.0)
        z1: _Axis = (0.0, 0.0, 1.0)
        z2, x2 = _turn(z1, x1, lift)
        y3, z3 = _turn(y1, z2, upper_arm_roll)
        z4, x4 = _turn(z3, x2, elbow)
        y5, z5 = _turn(y3, z4, forearm_roll)
        z6, x6 = _turn(z5, x4, wrist)
        y7, z7 = _turn(y5, z6, wrist_roll)

        p1: _Axis = tuple(self.p_RA.tolist())
        p2 = _step(p1, x1, shoulder_m)
        p4 = _step(p2, x2, upper_arm_m)
        p6 = _step(p4, x4, forearm_m)
        p8 = _step(p6, x6, tool_m)

        # One flat array: nested ones take several times as long to make.
        axes = (z1, y1, x2, y3, x4, y5, x6)
        points = (p1, p2, p2, p4, p4, p6, p6)
        ax, ay, az = zip(*axes, strict=True)
        mx, my, mz = zip(*map(_cross, axes, points), strict=True)
        back_x, back_y, back_z = [-a for a in ax], [-a for a in ay], [-a for a in az]
        frames = (
            *(*x1, *y1, *z1),
            *(*x2, *y1, *z2),
            *(*x2, *y3, *z3),
            *(*x4, *y3, *z4),
            *(*x4, *y5, *z5),
            *(*x6, *y5, *z6),
            *(*x6, *y7, *z7),
        )
        crosses = (*_ZEROS, *az, *back_y, *back_z, *_ZEROS, *ax, *ay, *back_x, *_ZEROS)
        numbers = np.array(
            (
                *frames,
                *(*p1, *p2, *p2, *p4, *p4, *p6, *p6, *p8),
                *(*ax, *ay, *az),
                *(*mx, *my, *mz),
                *crosses,
            )
        )
        numbers.flags.writeable = False  # Shared by all who ask for this configuration.
        p_RE, moment, turn = (
            numbers[84:87],
            numbers[108:129].reshape(3, 7),
            numbers[129:].reshape(3, 21),
        )
        Jv_E = (p_RE @ turn).reshape(3, 7) - moment
        Jv_E.flags.writeable = False
        return Pr2Pose(
            R_RL=numbers[:63].reshape(7, 3, 3).swapaxes(1, 2),
            p_RL=numbers[63:84].reshape(7, 3),
            p_RE=p_RE,
            Jv_E=Jv_E,
            Jw_E=numbers[87:108].reshape(3, 7),
            turn=turn,
            moment=moment,
        )


def calc_point_jacobians(pose: Pr2Pose, links: NDArray[np.intp], p_RQ: Vector) -> Vector:
    """Returns Jv_v_RQ of points on links, shape (n, 3, 7), m/rad.

    Args:
        pose: The arm's pose.
        links: Index of the link of each point, 0 to 6, shape (n,); joints beyond it do not count.
        p_RQ: Positions of the points, shape (n, 3), metres.
    """
    jacobians: Vector = (p_RQ @ pose.turn).reshape(-1, 3, 7) - pose.moment
    jacobians *= _MOVES[links][:, None]
    return jacobians


def _turn(u: _Axis, v: _Axis, angle: float) -> tuple[_Axis, _Axis]:
    """Returns the axes u and v of a frame that has turned about the third one, from u to v."""
    c, s = math.cos(angle), math.sin(angle)
    u1, u2, u3 = u
    v1, v2, v3 = v
    return (
        (c * u1 + s * v1, c * u2 + s * v2, c * u3 + s * v3),
        (c * v1 - s * u1, c * v2 - s * u2, c * v3 - s * u3),
    )


def _step(p: _Axis, u: _Axis, length: float) -> _Axis:
    return (p[0] + length * u[0], p[1] + length * u[1], p[2] + length * u[2])


def _cross(a: _Axis, b: _Axis) -> _Axis:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
