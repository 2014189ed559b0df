"""Kinematics for tests that do not need Drake."""

import numpy as np

from lic_drake.robots.arm import Arm


def link_origins(arm: Arm, q: np.ndarray) -> np.ndarray:
    """Returns joints and tip of a planar arm with links along -y, shape (4, 2), metres."""
    lengths = np.linalg.norm(np.diff(_joints(arm, np.zeros(len(q))), axis=0), axis=1)
    angles = np.cumsum(q) - 0.5 * np.pi
    steps = lengths[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.zeros(2), np.cumsum(steps, axis=0)])


def _joints(arm: Arm, q: np.ndarray) -> np.ndarray:
    pose = arm.calc_pose(q)
    return np.vstack([pose.p_RL, pose.p_RE])


def only(q: np.ndarray) -> np.ndarray | None:
    """Returns the first solution of an arm's inverse kinematics, None if there is none."""
    return q[0] if len(q) else None
