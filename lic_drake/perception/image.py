"""`CameraImage`: colours and depths, and the pose that the robot believes its camera to have."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector


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
        """Returns where points in front of the camera appear: (column, row), shape (.., 2), pixels.

        Args:
            p_WQ: The points, shape (.., 3), metres.
        """
        return self.project_from_camera((p_WQ - self.p_WC) @ self.R_WC)

    def project_from_camera(self, p_CQ: Vector) -> Vector:
        """Returns where points appear, (column, row), shape (.., 2), pixels.

        Args:
            p_CQ: Points in the camera's frame, shape (.., 3), metres.
        """
        height, width = self.shape
        centre = np.array([0.5 * width - 0.5, 0.5 * height - 0.5])
        return np.asarray(self.focal_px * p_CQ[..., :2] / p_CQ[..., 2:] + centre)
