"""Finds a board's apertures in an image, and which of them are open (paper V-B, Fig. 2)."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates, uniform_filter
from scipy.special import ndtr

from lic_drake.errors import ScenarioError
from lic_drake.perception.board_grid import BoardGrid, fit_grid
from lic_drake.perception.board_plane import BoardPlane, find_board_plane
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import pose_covariance
from lic_drake.types import Vector

STATES = ("open", "partly", "blocked", "unseen")
"""What an aperture can be found to be."""

NEAR_M = 0.03
"""What is no further behind the board's front covers it; what is further before it hides it."""

OPEN_SHARE, BLOCKED_SHARE = 0.15, 0.85
"""An aperture is open, or blocked, if less, or more, than this share of it is covered."""

MIN_SEEN = 0.5
"""An aperture of which less is seen is in no other state than unseen."""

EDGE_M = 0.005
"""A strip at the edges of what is seen through an opening does not count."""

MEASURED_SHARE = 0.4
"""A pixel without depth is a gap if around it more than this has depth: at a straight edge of the
wood less, beyond it, and more before it."""

_RESOLUTION_M = 0.0025
_SAMPLES = 60
_GAP_PX = 5


@dataclass(frozen=True, kw_only=True)
class BoardModel:
    """What is known of the board before anything is seen.

    Attributes:
        rows: Number of rows of apertures.
        columns: Number of columns.
        aperture_m: Distance of neighbouring apertures' centres, metres.
    """

    rows: int = 4
    columns: int = 5
    aperture_m: float = 0.2

    def __post_init__(self) -> None:
        if self.rows < 1 or self.columns < 1 or not 0.0 < self.aperture_m < np.inf:
            raise ScenarioError(
                "a board needs rows and columns from 1 and a positive aperture_m, got"
                f" {self.rows}, {self.columns} and {self.aperture_m}"
            )


@dataclass(frozen=True, kw_only=True)
class DetectedApertures:
    """The apertures of a board, row by row from below, each row from its right to its left.

    Attributes:
        p_WA: Centres, in the middle of the board, shape (n, 3), metres.
        covariance: Of the centres, shape (n, 3, 3), m^2.
        corners: Corners of the openings at the front of the board, shape (n, 4, 3), metres.
        covered: Share of what is seen of each opening that is covered, shape (n,).
        seen: Share of each opening that is seen, shape (n,).
        probability_open: Probability that an aperture is open, shape (n,).
    """

    p_WA: Vector
    covariance: Vector
    corners: Vector
    covered: Vector
    seen: Vector
    probability_open: Vector

    @property
    def states(self) -> tuple[str, ...]:
        """Each aperture's state, one of `STATES`."""
        by_share = np.digitize(self.covered, [OPEN_SHARE, BLOCKED_SHARE])
        return tuple(
            STATES[k] if seen >= MIN_SEEN else "unseen"
            for k, seen in zip(by_share, self.seen, strict=True)
        )


def find_apertures(
    image: CameraImage, camera: CameraConfig, board: BoardModel
) -> DetectedApertures:
    """Finds the board and looks into its apertures.

    Bars are taken to be as thick as they are wide, because only their fronts are seen.

    Args:
        image: What the camera sees.
        camera: Gives the errors of depths and of the camera's pose.
        board: What is known of the board.

    Raises:
        PerceptionError: There is no such board in view.
    """
    plane = find_board_plane(image, camera)
    grid = _fit_grid(image, plane, board)
    # Covers do not lie quite in the plane of the bars' fronts.
    plane = plane.shifted(_depth_of_bars(image, plane, grid))
    grid = _fit_grid(image, plane, board)
    covers = _covers(image, plane)
    clear = board.aperture_m - grid.bar_m
    centres = grid.cell_centres()
    at = grid.to_plane(_look_into(centres, clear, grid, plane.p_BC))
    values = _sample(covers, image, plane, at[..., 0], at[..., 1])
    known = np.isfinite(values)
    seen = known.mean(axis=1)
    covered = np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    corner = 0.5 * clear * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = grid.to_plane(centres[:, np.newaxis] + corner)
    pixel_m = plane.p_CO[2] / image.focal_px
    p_WA = _in_world(image, plane, grid.to_plane(centres), 0.5 * grid.bar_m)
    return DetectedApertures(
        p_WA=p_WA,
        covariance=np.array(
            [
                _covariance(image, plane, camera, grid, c, p)
                for c, p in zip(centres, p_WA, strict=True)
            ]
        ),
        corners=_in_world(image, plane, corners, 0.0),
        covered=covered,
        seen=seen,
        probability_open=_probability_open(covered, seen, pixel_m / clear),
    )


def _fit_grid(image: CameraImage, plane: BoardPlane, board: BoardModel) -> BoardGrid:
    covers = _covers(image, plane)
    return fit_grid(
        lambda y, z: _sample(covers, image, plane, y, z),
        board.rows,
        board.columns,
        board.aperture_m,
        _extent(covers, image, plane),
        plane.p_BC * [-1.0, 1.0, 1.0],
        _RESOLUTION_M,
    )


def _depth_of_bars(image: CameraImage, plane: BoardPlane, grid: BoardGrid) -> float:
    """Returns how far behind a plane the fronts of the bars are, metres."""
    at = grid.to_plane(grid.bar_points(_RESOLUTION_M))
    behind = _sample(plane.depth_behind(image), image, plane, at[:, 0], at[:, 1])
    behind = behind[np.abs(behind) < NEAR_M]
    return float(np.mean(behind)) if len(behind) else 0.0


def _covers(image: CameraImage, plane: BoardPlane) -> Vector:
    """Returns 1 for pixels that show the board or a cover, 0 behind them, NaN before them."""
    behind = plane.depth_behind(image)
    near = np.where(np.isnan(behind), 0.0, behind < NEAR_M)
    measured = np.isfinite(behind).astype(float)
    # Wood and covers give depths but for scattered gaps. Larger gaps are further than the camera
    # can see, which is open as well.
    around = uniform_filter(near, _GAP_PX), uniform_filter(measured, _GAP_PX)
    filled = (around[0] > 0.5 * around[1]) & (around[1] > MEASURED_SHARE)
    covers = np.where(np.isnan(behind), filled, near)
    return np.where(behind < -NEAR_M, np.nan, covers)


def _sample(covers: Vector, image: CameraImage, plane: BoardPlane, y: Vector, z: Vector) -> Vector:
    """Returns the values of the pixels that show points (y, z) of the plane; NaN out of view."""
    p_CQ = plane.p_CO + np.stack([np.zeros_like(y), y, z], axis=-1) @ plane.R_CB.T
    column, row = np.moveaxis(image.project_from_camera(p_CQ), -1, 0)
    values: Vector = map_coordinates(covers, [row, column], order=0, cval=np.nan)
    return np.where(p_CQ[..., 2] > 0.0, values, np.nan)


def _extent(covers: Vector, image: CameraImage, plane: BoardPlane) -> Vector:
    """Returns least and greatest (y, z) in the plane of what the image can show, shape (2, 2)."""
    rays = image.rays()[covers == 1.0]
    scale = (plane.p_CO @ plane.R_CB[:, 0]) / (rays @ plane.R_CB[:, 0])
    p_BQ = (rays * scale[:, np.newaxis] - plane.p_CO) @ plane.R_CB[:, 1:]
    return np.array([p_BQ.min(axis=0), p_BQ.max(axis=0)])


def _look_into(centres: Vector, clear: float, grid: BoardGrid, p_BC: Vector) -> Vector:
    """Returns points of the board through which the camera sees past the bars.

    Args:
        centres: Apertures' centres, shape (n, 2), metres.
        clear: Width of the openings, metres.
        grid: The bars.
        p_BC: The camera's position in the plane's frame, shape (3,), metres.

    Returns:
        Shape (n, `_SAMPLES`^2, 2), metres.
    """
    eye = grid.to_board(p_BC[1:])
    hidden = grid.bar_m / (grid.bar_m - p_BC[0])
    low, high = centres - 0.5 * clear, centres + 0.5 * clear
    low = low + np.maximum(eye - low, 0.0) * hidden + EDGE_M
    high = high - np.maximum(high - eye, 0.0) * hidden - EDGE_M
    share = np.linspace(0.0, 1.0, _SAMPLES)
    shares = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
    points: Vector = low[:, np.newaxis] + shares * (high - low)[:, np.newaxis]
    return points


def _in_world(image: CameraImage, plane: BoardPlane, at: Vector, behind_m: float) -> Vector:
    """Returns points in W from (y, z) in the plane, shape (.., 2), and their depth behind it."""
    p_BQ = np.concatenate([np.full((*at.shape[:-1], 1), behind_m), at], axis=-1)
    p_WQ: Vector = image.p_WC + (plane.p_CO + p_BQ @ plane.R_CB.T) @ image.R_WC.T
    return p_WQ


def _covariance(
    image: CameraImage,
    plane: BoardPlane,
    camera: CameraConfig,
    grid: BoardGrid,
    centre: Vector,
    p_WA: Vector,
) -> Vector:
    R_WB = image.R_WC @ plane.R_CB
    in_B = np.zeros((3, 3))
    in_B[0, 0] = plane.sigma_m**2 + 0.25 * grid.covariance[3, 3]
    in_B[1:, 1:] = grid.covariance_at(centre)
    covariance: Vector = R_WB @ in_B @ R_WB.T + pose_covariance(
        p_WA - image.p_WC, camera.pose_error
    )
    return covariance


def _probability_open(covered: Vector, seen: Vector, edge_share: float) -> Vector:
    """Returns the probability that less than `OPEN_SHARE` of an opening is covered.

    A share is uncertain by a pixel along each side, and by half a pixel's noise. What is not seen
    of an aperture is as likely covered as it is not.

    Args:
        covered: Share of what is seen that is covered, shape (n,).
        seen: Share that is seen, shape (n,).
        edge_share: Width of a pixel, as a share of the opening's.
    """
    sigma = np.hypot(2.0 * edge_share, 0.02)
    least = covered * seen
    probability: Vector = 0.5 * sum(
        ndtr((OPEN_SHARE - share) / sigma) for share in (least, least + 1.0 - seen)
    )
    return probability
