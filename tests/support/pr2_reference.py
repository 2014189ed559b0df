"""The PR2's right arm from the published numbers alone: products of exponentials, no model file."""

import json
from pathlib import Path

import numpy as np
from scipy.linalg import expm

FACTS = json.loads((Path(__file__).parents[1] / "data" / "pr2_facts.json").read_text())
BODIES = [FACTS["moving_bodies"][joint.removesuffix("_joint")] for joint in FACTS["chain"][1:]]


def skew(v: np.ndarray) -> np.ndarray:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def joints_at_zero(torso_m: float) -> np.ndarray:
    """Origins of the seven joints in base_footprint with the arm straight, shape (7, 3)."""
    offsets = np.array([FACTS["joints"][name]["xyz_m"] for name in FACTS["chain"]])
    offsets[0, 2] += FACTS["base_link_above_base_footprint_m"] + torso_m
    return np.cumsum(offsets, axis=0)[1:]


def screws_of(base_pose: tuple[float, float, float], torso_m: float) -> np.ndarray:
    """Screw axes (w, v) of the arm in the frame of the base pose, shape (7, 6)."""
    X = stand(base_pose)
    axes = np.array([FACTS["joints"][name]["axis"] for name in FACTS["chain"][1:]]) @ X[:3, :3].T
    points = joints_at_zero(torso_m) @ X[:3, :3].T + X[:3, 3]
    return np.hstack([axes, np.cross(points, axes)])


def stand(base_pose: tuple[float, float, float]) -> np.ndarray:
    """Pose of base_footprint, shape (4, 4)."""
    x, y, theta = base_pose
    X = np.eye(4)
    X[:2, :2] = [[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]
    X[:2, 3] = x, y
    return X


def exponential(screw: np.ndarray, angle: float) -> np.ndarray:
    twist = np.zeros((4, 4))
    twist[:3, :3], twist[:3, 3] = skew(screw[:3]), screw[3:]
    return expm(twist * angle)


def motions(screws: np.ndarray, q: np.ndarray) -> np.ndarray:
    """What the joints up to each link have moved its points by, shape (7, 4, 4)."""
    X, result = np.eye(4), []
    for screw, angle in zip(screws, q, strict=True):
        X = X @ exponential(screw, angle)
        result.append(X)
    return np.array(result)


def link_poses(base_pose: tuple[float, float, float], torso_m: float, q: np.ndarray) -> np.ndarray:
    """Poses of the seven links and, last, of the tool frame, shape (8, 4, 4)."""
    at_zero = np.repeat(np.eye(4)[None], 8, axis=0)
    at_zero[:7, :3, 3] = joints_at_zero(torso_m)
    at_zero[7, :3, 3] = at_zero[6, :3, 3] + FACTS["tool_frame"]["xyz_m"]
    moved = motions(screws_of(base_pose, torso_m), q)[[0, 1, 2, 3, 4, 5, 6, 6]]
    return moved @ stand(base_pose) @ at_zero


def point_jacobian(
    base_pose: tuple[float, float, float], torso_m: float, q: np.ndarray, link: int, p: np.ndarray
) -> np.ndarray:
    """Angular and translational Jacobian of a point fixed to a link, now at p, shape (6, 7)."""
    screws = screws_of(base_pose, torso_m)
    moved = np.concatenate([np.eye(4)[None], motions(screws, q)])
    result = np.zeros((6, 7))
    for joint in range(link + 1):
        R, t = moved[joint, :3, :3], moved[joint, :3, 3]
        w = R @ screws[joint, :3]
        result[:3, joint] = w
        result[3:, joint] = R @ screws[joint, 3:] + np.cross(t, w) + np.cross(w, p)
    return result


def mass_matrix(q: np.ndarray) -> np.ndarray:
    """Mass matrix of the arm, shape (7, 7)."""
    stand_at, torso_m = (0.0, 0.0, 0.0), 0.1
    M = np.zeros((7, 7))
    for link, (body, X) in enumerate(zip(BODIES, link_poses(stand_at, torso_m, q), strict=False)):
        p_com = X[:3, :3] @ body["com_m"] + X[:3, 3]
        J = point_jacobian(stand_at, torso_m, q, link, p_com)
        i = body["inertia_kgm2"]
        inertia = np.array(
            [
                [i["ixx"], i["ixy"], i["ixz"]],
                [i["ixy"], i["iyy"], i["iyz"]],
                [i["ixz"], i["iyz"], i["izz"]],
            ]
        )
        M += J[:3].T @ X[:3, :3] @ inertia @ X[:3, :3].T @ J[:3] + body["mass_kg"] * J[3:].T @ J[3:]
    return M
