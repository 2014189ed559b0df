"""Kinematics of a three-link planar arm, in closed form and without Drake.

Frame R is the arm's base frame: x into the clutter, y to the left, all joints turn about +z. At
q = 0 the straight arm points along -y. A hand pose is x0 = (x, y, phi): the tip's position in R
and the last link's direction phi = q1 + q2 + q3 - pi/2, counted from +x.
"""

from dataclasses import dataclass

import numpy as np

from lic_drake.types import Vector


def wrap_angle(angle: float) -> float:
    """Returns the angle wrapped to [-pi, pi), radians."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


@dataclass(frozen=True, kw_only=True)
class PlanarArmKinematics:
    """Link lengths and joint limits with the maps between q and x0.

    Attributes:
        link_lengths: Distances joint to joint and last joint to tip, shape (3,), metres.
        q_min: Lower joint limits, shape (3,), radians.
        q_max: Upper joint limits, shape (3,), radians.
    """

    link_lengths: Vector
    q_min: Vector
    q_max: Vector

    @property
    def reach_m(self) -> float:
        """Distance of the tip from the base with the arm straight, metres."""
        return float(np.sum(self.link_lengths))

    def link_origins(self, q: Vector) -> Vector:
        """Returns the three joints and the tip in R, shape (4, 2), metres."""
        angles = np.cumsum(q) - 0.5 * np.pi
        steps = self.link_lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0 = (x, y, phi) of the configuration q, phi in [-pi, pi)."""
        tip = self.link_origins(q)[-1]
        return np.array([tip[0], tip[1], wrap_angle(float(np.sum(q)) - 0.5 * np.pi)])

    def tip_pose_jacobian(self, q: Vector) -> Vector:
        """Returns the derivative of x0 = (x, y, phi) by q, shape (3, 3)."""
        origins = self.link_origins(q)
        p_JE = origins[-1] - origins[:3]
        return np.vstack([-p_JE[:, 1], p_JE[:, 0], np.ones(3)])

    def point_jacobian(self, q: Vector, link: int, p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ of a point Q fixed to a link, shape (2, 3), m/rad.

        Args:
            q: Joint angles, shape (3,), radians.
            link: Index of the link that carries Q, 0 to 2; joints beyond it do not move Q.
            p_RQ: Position of Q in R, shape (2,), metres.
        """
        p_JQ = p_RQ - self.link_origins(q)[:3]
        jacobian = np.vstack([-p_JQ[:, 1], p_JQ[:, 0]])
        jacobian[:, link + 1 :] = 0.0
        return jacobian

    def within_limits(self, q: Vector, tolerance: float = 1e-9) -> bool:
        """Tells whether q keeps all joint limits, to a tolerance in radians."""
        return bool(np.all(q >= self.q_min - tolerance) and np.all(q <= self.q_max + tolerance))

    def solve_ik(self, x0: Vector) -> Vector | None:
        """Returns the configuration that puts the hand at x0, or None if none is legal.

        Where both elbow branches keep the joint limits the one with q2 >= 0 is taken: within
        the start line it is the only legal one nearly everywhere.

        Args:
            x0: Hand pose (x, y, phi) in R, metres and radians.
        """
        l1, l2, l3 = self.link_lengths
        phi = float(x0[2])
        wrist = np.array([x0[0] - l3 * np.cos(phi), x0[1] - l3 * np.sin(phi)])
        cos_q2 = (wrist @ wrist - l1**2 - l2**2) / (2.0 * l1 * l2)
        if abs(cos_q2) > 1.0 + 1e-12:  # Rounding must not refuse a straight elbow.
            return None
        bend = np.arccos(np.clip(cos_q2, -1.0, 1.0))
        for q2 in (bend, -bend):
            first_link = np.arctan2(wrist[1], wrist[0]) - np.arctan2(
                l2 * np.sin(q2), l1 + l2 * np.cos(q2)
            )
            q1 = wrap_angle(first_link + 0.5 * np.pi)
            q = np.array([q1, q2, wrap_angle(phi + 0.5 * np.pi - q1 - q2)])
            if self.within_limits(q):
                return q
        return None
