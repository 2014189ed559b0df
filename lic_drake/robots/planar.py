"""Three-link planar arms: the one of the 2-D testbed (paper V-A), or of any other description."""

import math
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame

from lic_drake.paths import models_dir
from lic_drake.robots.arm import Arm
from lic_drake.robots.kinematics import (
    LIMIT_TOLERANCE,
    ArmPose,
    Kinematics,
    cross_matrix,
    wrap_angle,
)
from lic_drake.types import Vector

_AXES = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
_TURN = cross_matrix(_AXES)
_AXES.flags.writeable = _TURN.flags.writeable = False


class PlanarKinematics(Kinematics):
    """Closed forms of three joints about +z and links along -y; phi = q1 + q2 + q3 - pi/2.

    The forward kinematics take a fifth of the time of those from the model, in a control loop that
    is short in the plane.
    """

    def __init__(self, arm: Arm, plant: MultibodyPlant, links: Sequence[Frame], tip: Frame) -> None:
        super().__init__(arm, plant, links, tip)
        if len(arm.q_min) != 3:
            raise ValueError(f"it has {len(arm.q_min)} degrees of freedom, not 3")
        self.link_lengths: Vector = np.linalg.norm(np.diff(arm.p_RJ, axis=0), axis=1)
        self._lengths = tuple(self.link_lengths.tolist())
        q = np.array([0.3, 0.7, 1.1])
        for field, ours, models in zip(
            ArmPose._fields, self.calc_pose(q), super().calc_pose(q), strict=True
        ):
            if not np.allclose(ours, models, atol=1e-6):
                raise ValueError(
                    f"at q = {q} rad its {field} is {np.round(models, 4).tolist()}, where the"
                    f" closed form has {np.round(ours, 4).tolist()}"
                )

    def calc_pose(self, q: Vector) -> ArmPose:
        """Returns the arm's pose at joint angles q, shape (3,), radians."""
        q1, q2, q3 = q.tolist()
        l1, l2, l3 = self._lengths
        c1, s1 = math.cos(q1), math.sin(q1)
        c2, s2 = math.cos(q1 + q2), math.sin(q1 + q2)
        c3, s3 = math.cos(q1 + q2 + q3), math.sin(q1 + q2 + q3)
        # Second joint, third joint, tip: at q = 0 the links point along -y.
        x2, y2 = l1 * s1, -l1 * c1
        x3, y3 = x2 + l2 * s2, y2 - l2 * c2
        xE, yE = x3 + l3 * s3, y3 - l3 * c3
        # One array for all, because making arrays takes most of the time.
        values = np.array(
            [
                *(c1, -s1, 0.0, s1, c1, 0.0, 0.0, 0.0, 1.0),
                *(c2, -s2, 0.0, s2, c2, 0.0, 0.0, 0.0, 1.0),
                *(c3, -s3, 0.0, s3, c3, 0.0, 0.0, 0.0, 1.0),
                *(0.0, 0.0, 0.0, x2, y2, 0.0, x3, y3, 0.0),
                *(xE, yE, 0.0),
                *(s3, c3, 0.0, -c3, s3, 0.0, 0.0, 0.0, 1.0),
                *(-yE, y2 - yE, y3 - yE, xE, xE - x2, xE - x3, 0.0, 0.0, 0.0),
                *(0.0, -y2, -y3, 0.0, x2, x3, 0.0, 0.0, 0.0),
            ]
        )
        values.flags.writeable = False
        return ArmPose(
            R_RL=values[:27].reshape(3, 3, 3),
            p_RL=values[27:36].reshape(3, 3),
            p_RE=values[36:39],
            R_RE=values[39:48].reshape(3, 3),
            Jv_E=values[48:57].reshape(3, 3),
            Jw_E=_AXES,
            turn=_TURN,
            moment=values[57:].reshape(3, 3),
        )

    def tip_pose(self, q: Vector) -> Vector:
        """Returns x0 = (x, y, phi), with the rounding that the records of libraries have."""
        angles = np.cumsum(q) - 0.5 * np.pi
        steps = self.link_lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        tip = np.cumsum(steps, axis=0)[-1]
        return np.array([tip[0], tip[1], wrap_angle(float(np.sum(q)) - 0.5 * np.pi)])

    def solve_ik(self, x0: Vector, near: Vector | None = None) -> Vector:
        """See `Kinematics.solve_ik`; without `near` only the branch with q2 >= 0, if it is legal.

        On the start line that is the only one nearly everywhere.
        """
        l1, l2, l3 = self.link_lengths
        phi = float(x0[2])
        wrist = np.array([x0[0] - l3 * np.cos(phi), x0[1] - l3 * np.sin(phi)])
        cos_q2 = (wrist @ wrist - l1**2 - l2**2) / (2.0 * l1 * l2)
        found: list[Vector] = []
        if abs(cos_q2) <= 1.0 + 1e-12:  # Rounding must not refuse a straight elbow.
            bend = np.arccos(np.clip(cos_q2, -1.0, 1.0))
            for q2 in (bend, -bend):
                inner = np.arctan2(l2 * np.sin(q2), l1 + l2 * np.cos(q2))
                q1 = wrap_angle(np.arctan2(wrist[1], wrist[0]) - inner + 0.5 * np.pi)
                q = np.array([q1, q2, wrap_angle(phi + 0.5 * np.pi - q1 - q2)])
                beyond = np.maximum(self.q_min - q, q - self.q_max)
                if np.all(beyond <= LIMIT_TOLERANCE):
                    found.append(q)
        if near is None:
            return np.array(found[:1]).reshape(-1, 3)
        found.sort(key=lambda q: float(np.linalg.norm(q - near)))
        return np.array(found).reshape(-1, 3)


def make_planar_arm(name: str, model: str | Path) -> Arm:
    """Returns a three-link planar arm of a URDF file or text like models/planar_arm.urdf.

    It has three links with a collision capsule each, whose joints turn about +z; at zero they point
    along -y from base to tip. Another kind of arm is a ScenarioError.
    """
    return Arm(name, model, height_range_m=(0.0, 0.0), is_planar=True, kinematics=PlanarKinematics)


@cache
def planar_arm() -> Arm:
    """Returns the planar arm, read once a process."""
    return make_planar_arm("planar-arm", models_dir() / "planar_arm.urdf")
