"""Errors of depth cameras: noise and gaps in their images, and errors of their believed poses.

The random error of a depth and the step in which depths come grow with the depth squared, because
such cameras measure disparities: Khoshelham and Elberink, "Accuracy and resolution of Kinect depth
data", Sensors 12 (2012).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from lic_drake.perception.config import CameraConfig, NoiseConfig, PoseErrorConfig
from lic_drake.perception.image import CameraImage
from lic_drake.types import Vector

_FAR_M = 1e6


def add_depth_noise(depth: Vector, config: NoiseConfig, rng: np.random.Generator) -> Vector:
    """Returns what a depth camera would measure.

    Args:
        depth: True depths along the optical axis, shape (height, width), metres; NaN where there
            is none.
        config: The errors.
        rng: Source of the draws.
    """
    disparity = 1.0 / depth
    disparity += config.depth_sigma_per_m * rng.standard_normal(depth.shape)
    if config.depth_step_per_m > 0.0:
        # The step of the disparity 1/z is uniform.
        disparity = config.depth_step_per_m * np.round(disparity / config.depth_step_per_m)
    known = np.nan_to_num(depth, nan=_FAR_M)
    jump = maximum_filter(known, 3) - minimum_filter(known, 3) > config.jump_m
    lost = rng.random(depth.shape) < np.where(jump, config.edge_dropout, config.dropout)
    return np.where(lost | ~(disparity > 0.0), np.nan, 1.0 / np.abs(disparity))


def add_color_noise(
    color: NDArray[np.uint8], config: NoiseConfig, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Returns a colour image, shape (height, width, 3), with normal noise."""
    noisy = color + config.color_sigma * rng.standard_normal(color.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


def disturbed_image(
    image: CameraImage, config: CameraConfig, rng: np.random.Generator
) -> CameraImage:
    """Returns an image with errors of its pixels and of its camera's believed pose.

    Args:
        image: An exact image.
        config: The camera.
        rng: Source of the draws.
    """
    error = config.pose_error
    R = Rotation.from_rotvec(np.deg2rad(error.rotation_deg) * rng.standard_normal(3)).as_matrix()
    p = error.translation_m * rng.standard_normal(3)
    return replace(
        image,
        color=add_color_noise(image.color, config.noise, rng),
        depth=add_depth_noise(image.depth, config.noise, rng),
        R_WC=image.R_WC @ R,
        p_WC=image.p_WC + image.R_WC @ p,
    )


def pose_covariance(p_CQ_W: Vector, config: PoseErrorConfig) -> Vector:
    """Returns the covariance of a point by the errors of the camera's pose, shape (3, 3), m^2.

    Args:
        p_CQ_W: The point relative to the camera, in W, shape (3,), metres.
        config: The errors, the same along all axes.
    """
    x, y, z = p_CQ_W
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.deg2rad(config.rotation_deg)
    return np.asarray(config.translation_m**2 * np.eye(3) + angle**2 * cross @ cross.T)
