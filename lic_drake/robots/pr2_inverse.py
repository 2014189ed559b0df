"""Inverse kinematics of the PR2's right arm in closed form, and Eq. (5) of the paper.

Given where the tool is and which way it points, the wrist is known, and the pan angle alone is
free: the distance from shoulder to wrist gives the elbow, two upper arm rolls bring the wrist to
the right side of the shoulder, the lift to the right height; forearm roll and wrist flex then point
the tool. Elbow and wrist bend one way only, so every pan angle has at most two configurations, and
a row of pan angles gives all families of them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.robots.pr2_kinematics import Pr2Kinematics
from lic_drake.types import Vector

NUM_PAN_ANGLES = 271
"""Pan angles that are tried over the joint's range: one every half degree."""

_SLACK = 1e-12
"""Cosines and sines may be beyond 1 by this much: rounding must not refuse a straight arm."""

_STRAIGHT = 1e-9
"""A bend whose sine is below this leaves the roll before it undefined."""

ROBOT_TO_CLUTTER = np.array([1.0, 0.0, 0.0])
"""The paper's x: from the robot to the clutter."""


class _Heading(NamedTuple):
    """Where wrist and tool lie, seen from the shoulder behind each pan angle; shapes (n, 3)."""

    p_SW: Vector
    u_S: Vector


def solve_pose(
    kinematics: Pr2Kinematics, p_RE: Vector, R_RE: Vector, pan: Vector | None = None
) -> Vector:
    """Returns configurations that bring the tool frame to a pose, shape (n, 7), radians.

    Args:
        kinematics: The arm.
        p_RE: Position of the tool frame, shape (3,), metres.
        R_RE: Its rotation, shape (3, 3).
        pan: Pan angles to try, shape (k,), radians; by default a row over the joint's range.

    Returns:
        All configurations within the joint limits, ordered by pan angle. Joints that turn for ever
        have angles in [-pi, pi).
    """
    q = solve_pointing(kinematics, p_RE, R_RE[:, 0], pan)
    for row in q:
        R_R6 = kinematics.calc_pose(*row.tolist()).R_RL[5]
        y_6 = R_R6.T @ R_RE[:, 1]
        row[6] = _wrap(np.arctan2(y_6[2], y_6[1]))
    return _keep_limits(kinematics, q)[0]


def solve_pointing(
    kinematics: Pr2Kinematics, p_RE: Vector, u_R: Vector, pan: Vector | None = None
) -> Vector:
    """Returns configurations that bring the tool to a place and direction, shape (n, 7), radians.

    The wrist roll, which changes neither, is 0: the middle of its range.

    Args:
        kinematics: The arm.
        p_RE: Position of the tool frame, shape (3,), or one for each pan angle, shape (k, 3),
            metres.
        u_R: Unit vector along which the tool points, shape (3,).
        pan: Pan angles to try, shape (k,), radians; by default a row over the joint's range.

    Returns:
        All configurations within the joint limits, ordered by pan angle, which vary the elbow about
        the line from shoulder to wrist.
    """
    return _solve(kinematics, p_RE, u_R, _pan_angles(kinematics) if pan is None else pan)[0]


def solve_pointing_from_each(kinematics: Pr2Kinematics, p_RE: Vector, u_R: Vector) -> list[Vector]:
    """Returns what `solve_pointing` does for each of k places, in less time than one by one.

    Args:
        kinematics: The arm.
        p_RE: Positions of the tool frame, shape (k, 3), metres.
        u_R: Unit vector along which the tool points, shape (3,).
    """
    pan = _pan_angles(kinematics)
    q, sample = _solve(kinematics, np.repeat(p_RE, len(pan), axis=0), u_R, np.tile(pan, len(p_RE)))
    return np.split(q, np.searchsorted(sample, len(pan) * np.arange(1, len(p_RE))))


def _pan_angles(kinematics: Pr2Kinematics) -> Vector:
    return np.linspace(kinematics.q_min[0], kinematics.q_max[0], NUM_PAN_ANGLES)


def _solve(
    kinematics: Pr2Kinematics, p_RE: Vector, u_R: Vector, pan: Vector
) -> tuple[Vector, NDArray[np.intp]]:
    """Returns what `solve_pointing` does, and the index of each row's pan angle, shape (n,)."""
    heading = _look_from_shoulder(kinematics, p_RE, u_R, pan)
    _, upper_arm, forearm, _ = kinematics.lengths
    cos_elbow = (np.sum(heading.p_SW**2, axis=1) - upper_arm**2 - forearm**2) / (
        2.0 * upper_arm * forearm
    )
    elbow = -np.arccos(np.clip(cos_elbow, -1.0, 1.0))
    # The wrist in the upper arm's frame: along its x axis, and to the side.
    along = upper_arm + forearm * np.cos(elbow)
    aside = -forearm * np.sin(elbow)
    is_bent = aside > _STRAIGHT
    sin_roll = np.where(is_bent, -heading.p_SW[:, 1], 0.0) / np.where(is_bent, aside, 1.0)
    reaches = (np.abs(cos_elbow) <= 1.0 + _SLACK) & (np.abs(sin_roll) <= 1.0 + _SLACK)
    reaches &= is_bent | (np.abs(heading.p_SW[:, 1]) <= _STRAIGHT)
    # What follows is only worked out where the arm is long enough.
    heading = _Heading(heading.p_SW[reaches], heading.u_S[reaches])
    pan, elbow, along, aside = (v[reaches] for v in (pan, elbow, along, aside))
    roll = np.arcsin(np.clip(sin_roll[reaches], -1.0, 1.0))
    branches = [
        _complete(heading, pan, roll, elbow, along, aside),
        _complete(heading, pan, np.pi - roll, elbow, along, aside),
    ]
    q = np.stack(branches, axis=1).reshape(-1, 7)
    # The roll's range is less than a turn, but does not lie about 0.
    q[:, 2] = kinematics.q_min[2] + np.mod(q[:, 2] - kinematics.q_min[2], 2.0 * np.pi)
    kept, legal = _keep_limits(kinematics, q)
    return kept, np.repeat(np.flatnonzero(reaches), 2)[legal]


def calc_preselection_cost(
    kinematics: Pr2Kinematics,
    q: Vector,
    x_R: Vector = ROBOT_TO_CLUTTER,
    alpha: float = 1.0,
    beta: float = 1.0,
) -> Vector:
    """Returns the cost of Eq. (5), shape (n,), 1/m: low when hand and forearm point to the clutter.

    C = 1 / (alpha |x'p_tw| + beta |x'p_te|), with p_tw and p_te from the tool to wrist and elbow.

    Args:
        kinematics: The arm.
        q: Configurations, shape (n, 7), radians.
        x_R: Unit vector from the robot to the clutter, shape (3,).
        alpha: Weight of the wrist, positive (the paper does not give it).
        beta: Weight of the elbow, positive (the paper does not give it).
    """
    pan, lift, upper_arm_roll, elbow, forearm_roll, wrist, _ = q.T[..., None]
    heading = kinematics.yaw + pan
    zero = np.zeros_like(pan)
    x, y = (
        np.hstack([np.cos(heading), np.sin(heading), zero]),
        np.hstack([-np.sin(heading), np.cos(heading), zero]),
    )
    z: Vector = np.broadcast_to([0.0, 0.0, 1.0], x.shape)
    z, upper_arm = _turn(z, x, lift)
    y, z = _turn(y, z, upper_arm_roll)
    z, forearm = _turn(z, upper_arm, elbow)
    y, z = _turn(y, z, forearm_roll)
    _, tool = _turn(z, forearm, wrist)
    wrist_to_tool = kinematics.lengths.tool * (tool @ x_R)
    elbow_to_tool = wrist_to_tool + kinematics.lengths.forearm * (forearm @ x_R)
    cost: Vector = 1.0 / (alpha * np.abs(wrist_to_tool) + beta * np.abs(elbow_to_tool))
    return cost


def _look_from_shoulder(
    kinematics: Pr2Kinematics, p_RE: Vector, u_R: Vector, pan: Vector
) -> _Heading:
    """Returns wrist and pointing direction in the frame of the pan link, moved to the shoulder."""
    p_AW = p_RE - kinematics.lengths.tool * u_R - kinematics.p_RA
    c, s = np.cos(kinematics.yaw + pan), np.sin(kinematics.yaw + pan)
    p_SW, u_S = (
        np.column_stack([c * x + s * y, c * y - s * x, z])
        for x, y, z in (np.broadcast_to(v, (len(pan), 3)).T for v in (p_AW, u_R))
    )
    p_SW[:, 0] -= kinematics.lengths.shoulder
    return _Heading(p_SW, u_S)


def _complete(
    heading: _Heading, pan: Vector, roll: Vector, elbow: Vector, along: Vector, aside: Vector
) -> Vector:
    """Returns the configurations of one upper arm roll a pan angle, shape (n, 7)."""
    x, _, z = heading.p_SW.T
    up = aside * np.cos(roll)
    lift = np.arctan2(up * x - along * z, along * x + up * z)
    ux, uy, uz = heading.u_S.T
    uz, ux = _turn(uz, ux, lift)
    uy, uz = _turn(uy, uz, roll)
    uz, ux = _turn(uz, ux, elbow)
    bend = np.hypot(uy, uz)
    wrist = -np.arctan2(bend, ux)
    forearm_roll = np.where(bend > _STRAIGHT, _wrap(np.arctan2(-uy, uz)), 0.0)
    return np.column_stack(
        [pan, lift, roll, elbow, forearm_roll, wrist, np.zeros_like(pan)],
    )


def _turn(u: Vector, v: Vector, angle: Vector) -> tuple[Vector, Vector]:
    """Returns axes u and v after they have turned from u to v.

    Components along two axes that turn the other way change alike.
    """
    c, s = np.cos(angle), np.sin(angle)
    return c * u + s * v, c * v - s * u


def _wrap(angle: Vector) -> Vector:
    """Returns angles wrapped to [-pi, pi), radians."""
    wrapped: Vector = np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
    return wrapped


def _keep_limits(
    kinematics: Pr2Kinematics, q: Vector, tolerance: float = 1e-9
) -> tuple[Vector, NDArray[np.bool_]]:
    """Returns the rows within the joint limits, what is beyond them by rounding set to them.

    The second value tells which rows of q, shape (n, 7), these are, shape (n,).
    """
    low, high = kinematics.q_min, kinematics.q_max
    legal = np.all((q >= low - tolerance) & (q <= high + tolerance), axis=1)
    return np.clip(q[legal], low, high), legal
