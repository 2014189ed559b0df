"""Finds the goal, a yellow ball, in an image (paper V-B)."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from skimage.color import rgb2hsv
from skimage.measure import label

from lic_drake.errors import PerceptionError
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage, pose_covariance
from lic_drake.types import Vector

YELLOW_HUE = (0.105, 0.19)
"""Range of hues of the ball (orange to greenish yellow), 0 to 1."""
YELLOW_SATURATION, YELLOW_VALUE = 0.6, 0.25
"""Least saturation and brightness of the ball, 0 to 1."""
MIN_PIXELS = 20
"""Least number of pixels of the ball."""
RIM = 0.2
"""Rays that enter the ball by less than this share of radius^2 are left out of the covariance."""


@dataclass(frozen=True, kw_only=True)
class DetectedGoal:
    """The centre of the detected ball, shape (3,), metres, and its covariance, (3, 3), m^2."""

    p_WG: Vector
    covariance: Vector


def find_goal(image: CameraImage, camera: CameraConfig, ball_radius_m: float) -> DetectedGoal:
    """Fits a ball to the depths of the largest yellow spot.

    The fit does not use the outline, so leaves in front of the ball do not shift it. `camera` gives
    the errors of depths and of the camera's pose.

    Raises:
        PerceptionError: No ball is in view.
    """
    hue, saturation, value = np.moveaxis(rgb2hsv(image.color), -1, 0)
    yellow = (hue > YELLOW_HUE[0]) & (hue < YELLOW_HUE[1])
    yellow &= (saturation > YELLOW_SATURATION) & (value > YELLOW_VALUE)
    spots = label(yellow)  # type: ignore[no-untyped-call]
    largest = 1 + np.argmax(np.bincount(spots[yellow], minlength=2)[1:])
    shown = (spots == largest) & np.isfinite(image.depth)
    depth, rays = image.depth[shown], image.rays()[shown]
    if len(depth) < MIN_PIXELS:
        raise PerceptionError(
            f"no yellow ball in view: the largest yellow spot has {len(depth)} pixels with depth,"
            f" at least {MIN_PIXELS} are needed; turn or move the external camera"
        )
    p_CG, covariance = _fit_ball(rays, depth, camera, ball_radius_m)
    p_WG = image.p_WC + image.R_WC @ p_CG
    return DetectedGoal(
        p_WG=p_WG,
        covariance=image.R_WC @ covariance @ image.R_WC.T
        + pose_covariance(p_WG - image.p_WC, camera.pose_error),
    )


def _fit_ball(
    rays: Vector, depth: Vector, camera: CameraConfig, radius_m: float
) -> tuple[Vector, Vector]:
    """Returns p_CG, shape (3,), metres, and its covariance by the noise, shape (3, 3)."""
    sigma = max(camera.noise.disparity_sigma_per_m, 1e-5)

    def residuals(p_CG: Vector) -> Vector:
        return (_disparity(rays, p_CG, radius_m) - 1.0 / depth) / sigma

    middle = np.median(rays * depth[:, np.newaxis], axis=0)
    first = middle * (1.0 + radius_m / np.linalg.norm(middle))
    fit = least_squares(residuals, first, loss="soft_l1", f_scale=2.0)
    # The depth's derivative is unbounded at the ball's rim.
    jacobian = fit.jac[_inside(rays, fit.x, radius_m) > RIM * radius_m**2 * np.sum(rays**2, axis=1)]
    if np.linalg.matrix_rank(jacobian) < 3:
        raise PerceptionError("only the ball's rim is in view; move the external camera")
    return fit.x, np.linalg.inv(jacobian.T @ jacobian)


def _inside(rays: Vector, p_CG: Vector, radius_m: float) -> Vector:
    """Returns radius^2 - distance^2 of rays from a ball's centre, times the rays' length^2."""
    squared = np.sum(rays**2, axis=1) * (p_CG @ p_CG - radius_m**2)
    return np.asarray((rays @ p_CG) ** 2 - squared)


def _disparity(rays: Vector, p_CG: Vector, radius_m: float) -> Vector:
    """Returns 1/z where rays meet a ball, or where they pass closest to it."""
    length2 = np.sum(rays * rays, axis=1)
    along = rays @ p_CG
    inside = _inside(rays, p_CG, radius_m)
    return np.asarray(length2 / (along - np.sqrt(np.maximum(inside, 0.0))))
