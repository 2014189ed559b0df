"""Collision-free paths of a PR2's arm between its waiting posture and the start of a reach."""

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.scenario import Scenario
from lic_drake.scene.collision import CollisionChecker
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

WAITING_DEG = np.array([-70.0, 40.0, -90.0, -125.0, 0.0, -60.0, 0.0])
"""Our posture for observing and driving: elbow out to the side, hand close to the body."""

RETREAT_M = 0.3
"""Length of the tool's straight path into an aperture, where joint limits allow it, metres."""

RETREAT_STEP_M = 0.01
"""Step length along that path, metres."""

MAX_NEWTON_STEPS = 10
"""Newton iterations of the inverse kinematics at each step."""

CHECKED_RAD = 0.03
"""Largest joint step between collision checks, radians."""

VIA_POINTS = 1000
"""Number of random via points that are tried where the direct path is not free."""


class Approach:
    """Plans the arm's path between its waiting posture and a start.

    Attributes:
        waiting: The waiting posture, shape (7,), radians.
    """

    def __init__(self, scenario: Scenario, instance: ClutterInstance) -> None:
        """Builds the collision checker."""
        self.waiting = np.deg2rad(WAITING_DEG)
        self._arm = scenario.arm()
        self._checker = CollisionChecker(self._arm, instance)

    def path(self, b0: Vector, q_start: Vector) -> Vector:
        """Returns a path from the waiting posture to a start, shape (k, 7), radians.

        Its last part is straight for the tool. Where no free path is found, for instance because
        the start lies in a pocket, the arm moves straight in joint space.
        """
        way_in = self._retreat(b0, q_start)[::-1]
        begin, end = self.waiting, way_in[0]
        rng = make_generator("evaluation", "approach")
        via = end
        for _ in range(VIA_POINTS):
            if self._is_free(b0, begin, via) and self._is_free(b0, via, end):
                return np.vstack([begin, via, way_in])
            near = end + rng.normal(0.0, 0.1 + 1.5 * rng.random(), len(end))
            via = np.clip(near, self._arm.q_min, self._arm.q_max)
        return np.array([begin, q_start])

    def _is_free(self, b0: Vector, q_from: Vector, q_to: Vector) -> bool:
        """Returns whether the arm touches nothing on a straight line in joint space."""
        steps = max(1, int(np.ceil(np.abs(q_to - q_from).max() / CHECKED_RAD)))
        line = q_to + np.linspace(0.0, 1.0, steps + 1)[:-1, np.newaxis] * (q_from - q_to)
        return not any(self._checker.touches(b0, q) for q in line)

    def _retreat(self, b0: Vector, q_start: Vector) -> Vector:
        """Returns joint angles that draw the tool back as far as possible, shape (k, 7)."""
        path = [q_start]
        pose = self._arm.calc_pose(q_start)
        p_RE, R_RE = pose.p_RE, pose.R_RE
        for k in range(1, round(RETREAT_M / RETREAT_STEP_M) + 1):
            q = self._follow(path[-1], p_RE - k * RETREAT_STEP_M * R_RE[:, 0], R_RE)
            if q is None or not self._is_free(b0, path[-1], q):
                break
            path.append(q)
        return np.array(path)

    def _follow(self, q: Vector, p_RE: Vector, R_RE: Vector) -> Vector | None:
        """Returns joint angles near q that bring the tool to a nearby pose, or None."""
        arm = self._arm
        for _ in range(MAX_NEWTON_STEPS):
            pose = arm.calc_pose(q)
            # The missing rotation as a vector, exact to second order.
            turn = 0.5 * np.cross(pose.R_RE, R_RE, axis=0).sum(axis=1)
            error = np.concatenate([p_RE - pose.p_RE, turn])
            if np.abs(error).max() < 1e-4:
                return q
            J = np.vstack([pose.Jv_E, pose.Jw_E])
            q = q + J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
            if np.any(q < arm.q_min) or np.any(q > arm.q_max):
                return None
        return None
