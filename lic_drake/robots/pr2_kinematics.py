"""Inverse kinematics of the PR2's right arm in closed form.

From the pan axis on the seven joints turn about z, y, x, y, x, y and x of the link they carry, and
all offsets lie along x: pan axis to shoulder, shoulder to elbow, elbow to wrist, wrist to tool. At
q = 0 the arm is straight.

A place and a direction of the tool give the wrist, and the pan angle alone is free: the distance
from shoulder to wrist gives the elbow, two upper arm rolls bring the wrist to the right side of the
shoulder, the lift to the right height; forearm roll and wrist flex then point the tool. Elbow and
wrist bend one way only, so every pan angle has at most two configurations.

Drake's inverse kinematics, which `Kinematics` has for any arm, find starts at as many apertures,
up to 7 % cheaper by Eq. (5), but take 5 ms of CPU for each and this 0.3 ms.
"""

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from lic_drake.robots.arm import Arm
from lic_drake.robots.kinematics import Kinematics, keep_limits, rigid_pose
from lic_drake.types import IntVector, Vector

NUM_PAN_ANGLES = 271
"""Pan angles that are tried over the joint's range: one every half degree."""

# Cosines and sines may be beyond 1 by this much: rounding must not refuse a straight arm.
_SLACK = 1e-12
# A bend whose sine is below this leaves the roll before it undefined.
_STRAIGHT = 1e-9
# The x of Eq. (5), from the robot to the clutter.
_X_R = np.array([1.0, 0.0, 0.0])


class Pr2Kinematics(Kinematics):
    """Inverse kinematics of the seven joints in closed form.

    Attributes:
        lengths: Pan axis to shoulder, upper arm, forearm, and wrist to tool, metres.
    """

    def __init__(self, arm: Arm, plant: MultibodyPlant, links: Sequence[Frame], tip: Frame) -> None:
        super().__init__(arm, plant, links, tip)
        if len(arm.q_min) != 7:
            raise ValueError(f"it has {len(arm.q_min)} degrees of freedom, not 7")
        self._p_RA = arm.p_RJ[0]
        steps = np.diff(arm.p_RJ[[0, 1, 3, 5, 7]], axis=0)
        self.lengths: list[float] = np.linalg.norm(steps, axis=1).tolist()
        self._pan_angles = np.linspace(self.q_min[0], self.q_max[0], NUM_PAN_ANGLES)

    def solve_ik(self, x0: Vector, near: Vector | None = None) -> Vector:
        """See `Kinematics.solve_ik`; with `near` only its own pan angle is tried."""
        p_RE, R_RE = rigid_pose(x0)
        q, _ = self._solve_at(p_RE, R_RE[:, 0], self._pan_angles if near is None else near[:1])
        _, _, y, z = _axes(q)
        q[:, 6] = _wrap(np.arctan2(z @ R_RE[:, 1], y @ R_RE[:, 1]))
        q, _ = keep_limits(q, self.q_min, self.q_max)
        if near is None:
            order = self.calc_preselection_cost(q)
        else:
            turned = q + 2.0 * np.pi * np.round((near - q) / (2.0 * np.pi))
            q = np.where((turned >= self.q_min) & (turned <= self.q_max), turned, q)
            order = np.linalg.norm(q - near, axis=1)
        return q[np.argsort(order, kind="stable")]

    def solve_pointing(self, p_RE: Vector, u_R: Vector) -> list[Vector]:
        """See `Kinematics.solve_pointing`; the wrist roll is 0, the middle of its range."""
        pan = self._pan_angles
        q, sample = self._solve_at(np.repeat(p_RE, len(pan), axis=0), u_R, np.tile(pan, len(p_RE)))
        # Those of one position after the other, the cheapest first.
        order = np.lexsort((self.calc_preselection_cost(q), sample // len(pan)))
        return np.split(q[order], np.searchsorted(sample, len(pan) * np.arange(1, len(p_RE))))

    def _solve_at(self, p_RE: Vector, u_R: Vector, pan: Vector) -> tuple[Vector, IntVector]:
        """Returns configurations that point along u_R, and the index of each one's pan angle.

        The tool's position may be one for all k pan angles, or one for each.
        """
        shoulder, upper_arm, forearm, tool = self.lengths
        # Wrist and direction in the frame of the pan link, moved to the shoulder, shape (k, 3).
        c, s = np.cos(pan), np.sin(pan)
        p_SW, u_S = (
            np.column_stack([c * x + s * y, c * y - s * x, z])
            for x, y, z in (
                np.broadcast_to(v, (len(pan), 3)).T for v in (p_RE - tool * u_R - self._p_RA, u_R)
            )
        )
        p_SW[:, 0] -= shoulder
        cos_elbow = (np.sum(p_SW**2, axis=1) - upper_arm**2 - forearm**2) / (
            2.0 * upper_arm * forearm
        )
        elbow = -np.arccos(np.clip(cos_elbow, -1.0, 1.0))
        # The wrist in the upper arm's frame: along its x axis, and to the side.
        along = upper_arm + forearm * np.cos(elbow)
        aside = -forearm * np.sin(elbow)
        is_bent = aside > _STRAIGHT
        sin_roll = np.where(is_bent, -p_SW[:, 1], 0.0) / np.where(is_bent, aside, 1.0)
        reaches = (np.abs(cos_elbow) <= 1.0 + _SLACK) & (np.abs(sin_roll) <= 1.0 + _SLACK)
        reaches &= is_bent | (np.abs(p_SW[:, 1]) <= _STRAIGHT)
        # What follows is only worked out where the arm is long enough.
        known = [v[reaches] for v in (p_SW, u_S, pan, elbow, along, aside)]
        roll = np.arcsin(np.clip(sin_roll[reaches], -1.0, 1.0))
        branches = [_complete(branch, *known) for branch in (roll, np.pi - roll)]
        q = np.stack(branches, axis=1).reshape(-1, 7)
        # The roll's range is less than a turn, but does not lie about 0.
        q[:, 2] = self.q_min[2] + np.mod(q[:, 2] - self.q_min[2], 2.0 * np.pi)
        kept, legal = keep_limits(q, self.q_min, self.q_max)
        return kept, np.repeat(np.flatnonzero(reaches), 2)[legal]

    def calc_preselection_cost(self, q: Vector, alpha: float = 1.0, beta: float = 1.0) -> Vector:
        """Returns the cost of Eq. (5), shape (n,), 1/m: low when hand and forearm point inward.

        C = 1 / (alpha |x'p_tw| + beta |x'p_te|), p_tw and p_te from the tool to wrist and elbow;
        the paper does not give the positive weights alpha and beta.
        """
        forearm, tool, _, _ = _axes(q)
        wrist_to_tool = self.lengths[3] * (tool @ _X_R)
        elbow_to_tool = wrist_to_tool + self.lengths[2] * (forearm @ _X_R)
        return 1.0 / (alpha * np.abs(wrist_to_tool) + beta * np.abs(elbow_to_tool))


def _axes(q: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Returns directions of forearm and tool, and y and z of the wrist link, shape (n, 3) each."""
    pan, lift, upper_arm_roll, elbow, forearm_roll, wrist, _ = q.T[..., None]
    zero = np.zeros_like(pan)
    x = np.hstack([np.cos(pan), np.sin(pan), zero])
    y = np.hstack([-np.sin(pan), np.cos(pan), zero])
    z: Vector = np.broadcast_to([0.0, 0.0, 1.0], x.shape)
    z, upper_arm = _turn(z, x, lift)
    y, z = _turn(y, z, upper_arm_roll)
    z, forearm = _turn(z, upper_arm, elbow)
    y, z = _turn(y, z, forearm_roll)
    z, tool = _turn(z, forearm, wrist)
    return forearm, tool, y, z


def _complete(
    roll: Vector,
    p_SW: Vector,
    u_S: Vector,
    pan: Vector,
    elbow: Vector,
    along: Vector,
    aside: Vector,
) -> Vector:
    """Returns the configurations of one upper arm roll a pan angle, shape (n, 7)."""
    x, _, z = p_SW.T
    up = aside * np.cos(roll)
    lift = np.arctan2(up * x - along * z, along * x + up * z)
    ux, uy, uz = u_S.T
    uz, ux = _turn(uz, ux, lift)
    uy, uz = _turn(uy, uz, roll)
    uz, ux = _turn(uz, ux, elbow)
    bend = np.hypot(uy, uz)
    wrist = -np.arctan2(bend, ux)
    forearm_roll = np.where(bend > _STRAIGHT, _wrap(np.arctan2(-uy, uz)), 0.0)
    return np.column_stack([pan, lift, roll, elbow, forearm_roll, wrist, np.zeros_like(pan)])


def _turn(u: Vector, v: Vector, angle: Vector) -> tuple[Vector, Vector]:
    """Returns axes u and v after they have turned from u to v, or components along them."""
    c, s = np.cos(angle), np.sin(angle)
    return c * u + s * v, c * v - s * u


def _wrap(angle: Vector) -> Vector:
    """Returns angles wrapped to [-pi, pi), radians."""
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi
