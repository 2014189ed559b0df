"""How a PR2's arm comes to the start of a reach, and away from it, without touching the board."""

from collections.abc import Callable

import numpy as np

from lic_drake.reach.pointing_starts import mobile_positions
from lic_drake.robots.pr2 import Pr2Arm, pr2_arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.seeds import make_generator
from lic_drake.show.motion_planning import is_path_free, plan_motion
from lic_drake.types import Vector

MAX_NEWTON_STEPS = 10
"""Of the inverse kinematics along that way; where they do not suffice, the way ends."""

WAITING_DEG = np.array([-70.0, 40.0, -90.0, -125.0, 0.0, -60.0, 0.0])
"""A posture of ours for looking and driving: elbow out to the side, hand close before the body."""

RETREAT_M = 0.3
"""The tool comes straight into an aperture from so far away, where the joint limits allow it."""

RETREAT_STEP_M = 0.01
"""Steps of that way."""


def plan_approach(checker: CollisionChecker, b0: Vector, q_start: Vector) -> Vector | None:
    """Returns a path of the arm from its waiting posture to a start, shape (k, 7), radians.

    Its last part is straight for the tool. None if no path was found: the start may lie in a
    pocket.

    Args:
        checker: The mobile robot before the board.
        b0: Place of the base and height of the torso, shape (3,), metres.
        q_start: Joint angles at the start, shape (7,), radians.
    """
    arm = pr2_arm().raised(float(b0[2]))

    def is_free(q: Vector) -> bool:
        return not checker.touches(mobile_positions(b0, q[None])[0])

    way_out = _retreat(arm, is_free, q_start)
    way = plan_motion(
        is_free,
        arm.q_min,
        arm.q_max,
        np.deg2rad(WAITING_DEG),
        way_out[-1],
        make_generator("evaluation", "approach"),
    )
    return None if way is None else np.vstack([way, way_out[-2::-1]])


def _retreat(arm: Pr2Arm, is_free: Callable[[Vector], bool], q_start: Vector) -> Vector:
    """Returns joint angles that draw the tool back as far as the arm can, shape (k, 7)."""
    path = [q_start]
    p_RE, R_RE = arm.tip_position(q_start), arm.tip_rotation(q_start)
    for k in range(1, round(RETREAT_M / RETREAT_STEP_M) + 1):
        q = _follow(arm, path[-1], p_RE - k * RETREAT_STEP_M * R_RE[:, 0], R_RE)
        if q is None or not is_path_free(is_free, path[-1], q):
            break
        path.append(q)
    return np.array(path)


def _follow(arm: Pr2Arm, q: Vector, p_RE: Vector, R_RE: Vector) -> Vector | None:
    """Returns joint angles near q that bring the tool to a pose near its own, or None."""
    for _ in range(MAX_NEWTON_STEPS):
        R = arm.tip_rotation(q)
        # The rotation that is missing, as a vector; exact to second order.
        turn = 0.5 * np.cross(R, R_RE, axis=0).sum(axis=1)
        error = np.concatenate([p_RE - arm.tip_position(q), turn])
        if np.abs(error).max() < 1e-4:
            return q
        J = np.vstack([arm.tip_jacobian(q), arm.tip_angular_jacobian(q)])
        q = q + J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
        if np.any(q < arm.q_min) or np.any(q > arm.q_max):
            return None
    return None
