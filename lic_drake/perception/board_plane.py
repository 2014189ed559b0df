"""Finds the plane of a wooden board in a colour and depth image."""

from dataclasses import dataclass, replace

import numpy as np
from skimage.color import rgb2hsv

from lic_drake.errors import PerceptionError
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage
from lic_drake.types import Vector

WOOD_HUE = (0.04, 0.13)
"""Range of hues of the bars (between red and yellow), 0 to 1."""
WOOD_SATURATION = 0.2
"""Least saturation of the bars, 0 to 1: brown is not grey."""

MIN_PIXELS = 500
"""Least number of brown pixels of a board in view."""

MAX_SAMPLES = 20_000
"""Largest number of brown pixels that are fitted."""


@dataclass(frozen=True, kw_only=True)
class BoardPlane:
    """The front of the board, in the camera's frame C.

    Attributes:
        p_CO: Where the optical axis meets the plane, shape (3,), metres.
        R_CB: Axes Bx away from the camera, across the board, By to its left and Bz up, shape
            (3, 3).
        sigma_m: Standard deviation of the plane's distance, metres.
    """

    p_CO: Vector
    R_CB: Vector
    sigma_m: float

    @property
    def p_BC(self) -> Vector:
        """Position of the camera from O, in B, shape (3,), metres."""
        return np.asarray(-self.p_CO @ self.R_CB)

    def shifted(self, behind_m: float) -> "BoardPlane":
        """Returns the plane moved back by a distance, metres."""
        along = self.p_CO @ self.R_CB[:, 0]
        return replace(self, p_CO=self.p_CO * (1.0 + behind_m / along))

    def depth_behind(self, image: CameraImage) -> Vector:
        """Returns how far behind the plane each pixel's point is, shape (height, width), metres."""
        n_C = self.R_CB[:, 0]
        return np.asarray(image.depth * (image.rays() @ n_C) - self.p_CO @ n_C)

    def to_camera(self, at: Vector, behind_m: float = 0.0) -> Vector:
        """Returns p_CQ, shape (.., 3), of points (y, z) in the plane, shape (.., 2), metres."""
        p_BQ = np.concatenate([np.full((*at.shape[:-1], 1), behind_m), at], axis=-1)
        return np.asarray(self.p_CO + p_BQ @ self.R_CB.T)


def find_board_plane(image: CameraImage, camera: CameraConfig) -> BoardPlane:
    """Returns the plane in which most of the brown pixels lie.

    In a plane the disparity 1/z is a linear function of the pixel, and its error is uniform.

    Args:
        image: What the camera sees.
        camera: Gives the errors of depths.

    Raises:
        PerceptionError: No board is in view.
    """
    # Takes half a second to import, and reaches do not need it.
    from sklearn.linear_model import LinearRegression, RANSACRegressor

    hue, saturation, _ = np.moveaxis(rgb2hsv(image.color), -1, 0)
    brown = (hue > WOOD_HUE[0]) & (hue < WOOD_HUE[1]) & (saturation > WOOD_SATURATION)
    brown &= np.isfinite(image.depth)
    if np.count_nonzero(brown) < MIN_PIXELS:
        raise PerceptionError(
            f"no board in view: {np.count_nonzero(brown)} brown pixels with depth, at least"
            f" {MIN_PIXELS} are needed; turn the camera towards the board"
        )
    rays, disparity = image.rays()[brown][:, :2], 1.0 / image.depth[brown]
    every = slice(None, None, -(-len(disparity) // MAX_SAMPLES))
    rays, disparity = rays[every], disparity[every]
    sigma = camera.noise.disparity_sigma_per_m
    fit = RANSACRegressor(
        LinearRegression(), residual_threshold=3.0 * max(sigma, 1e-4), random_state=0, min_samples=3
    ).fit(rays, disparity)
    n_C = np.append(fit.estimator_.coef_, fit.estimator_.intercept_)
    inliers = np.count_nonzero(fit.inlier_mask_)
    if inliers < MIN_PIXELS or n_C[2] <= 0.0:
        raise PerceptionError("no board in view: the brown pixels do not lie in a plane")
    z = 1.0 / n_C[2]
    n_C /= np.linalg.norm(n_C)
    up_C = image.R_WC.T[:, 2] - (image.R_WC.T[:, 2] @ n_C) * n_C
    up_C /= np.linalg.norm(up_C)
    return BoardPlane(
        p_CO=np.array([0.0, 0.0, z]),
        R_CB=np.column_stack([n_C, np.cross(up_C, n_C), up_C]),
        sigma_m=sigma * z**2 / np.sqrt(inliers),
    )
