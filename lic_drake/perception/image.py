"""Images of depth cameras, and the cameras' errors.

The random error of a depth and the step in which depths come grow with the depth squared, because
such cameras measure disparities: Khoshelham and Elberink, "Accuracy and resolution of Kinect depth
data", Sensors 12 (2012).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from lic_drake.perception.config import CameraConfig, NoiseConfig, PoseErrorConfig
from lic_drake.types import Vector

_FAR_M = 1e6


@dataclass(frozen=True, kw_only=True)
class CameraImage:
    """Everything that perception gets from a camera.

    Attributes:
        color: Shape (height, width, 3).
        depth: Along the optical axis, shape (height, width), metres; NaN where nothing was
            measured.
        focal_px: Focal length, pixels.
        R_WC: The camera's believed axes in W, shape (3, 3): x right, y down, z forward in the
            image.
        p_WC: Its believed position, shape (3,), metres.
    """

    color: NDArray[np.uint8]
    depth: Vector
    focal_px: float
    R_WC: Vector
    p_WC: Vector

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width in pixels."""
        return self.depth.shape[0], self.depth.shape[1]

    def rays(self) -> Vector:
        """Returns p_CQ of the points at depth 1 that the pixels show, shape (height, width, 3)."""
        height, width = self.shape
        # Pixels are numbered by their centres; the optical axis is in the middle of the image.
        u = (np.arange(width) - (0.5 * width - 0.5)) / self.focal_px
        v = (np.arange(height) - (0.5 * height - 0.5)) / self.focal_px
        u, v = np.meshgrid(u, v)
        return np.stack([u, v, np.ones_like(u)], axis=-1)

    def project(self, p_WQ: Vector) -> Vector:
        """Returns where points (.., 3) before the camera appear: (column, row), shape (.., 2)."""
        return self.project_from_camera((p_WQ - self.p_WC) @ self.R_WC)

    def project_from_camera(self, p_CQ: Vector) -> Vector:
        """Returns where points (.., 3) in the camera's frame appear, as `project` does."""
        height, width = self.shape
        centre = np.array([0.5 * width - 0.5, 0.5 * height - 0.5])
        return np.asarray(self.focal_px * p_CQ[..., :2] / p_CQ[..., 2:] + centre)


def add_depth_noise(depth: Vector, config: NoiseConfig, rng: np.random.Generator) -> Vector:
    """Returns what would be measured of true depths, shape (height, width), metres or NaN."""
    disparity = 1.0 / depth
    disparity += config.depth_sigma_per_m * rng.standard_normal(depth.shape)
    if config.depth_step_per_m > 0.0:
        # The step of the disparity 1/z is uniform.
        disparity = config.depth_step_per_m * np.round(disparity / config.depth_step_per_m)
    known = np.nan_to_num(depth, nan=_FAR_M)
    jump = maximum_filter(known, 3) - minimum_filter(known, 3) > config.jump_m
    lost = rng.random(depth.shape) < np.where(jump, config.edge_dropout, config.dropout)
    return np.where(lost | ~(disparity > 0.0), np.nan, 1.0 / np.abs(disparity))


def disturbed_image(
    image: CameraImage, config: CameraConfig, rng: np.random.Generator
) -> CameraImage:
    """Returns an exact image with errors of its pixels and of its camera's believed pose."""
    error = config.pose_error
    R = Rotation.from_rotvec(np.deg2rad(error.rotation_deg) * rng.standard_normal(3)).as_matrix()
    p = error.translation_m * rng.standard_normal(3)
    color = image.color + config.noise.color_sigma * rng.standard_normal(image.color.shape)
    return replace(
        image,
        color=np.clip(np.round(color), 0, 255).astype(np.uint8),
        depth=add_depth_noise(image.depth, config.noise, rng),
        R_WC=image.R_WC @ R,
        p_WC=image.p_WC + image.R_WC @ p,
    )


def pose_covariance(p_CQ_W: Vector, config: PoseErrorConfig) -> Vector:
    """Returns the covariance of a point by the errors of the camera's pose, shape (3, 3), m^2.

    p_CQ_W is the point relative to the camera, in W, shape (3,), metres.
    """
    x, y, z = p_CQ_W
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.deg2rad(config.rotation_deg)
    return np.asarray(config.translation_m**2 * np.eye(3) + angle**2 * cross @ cross.T)
