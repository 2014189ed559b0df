"""Finds a board's apertures in an image and classifies them as open or closed (paper V-B)."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates, uniform_filter
from scipy.special import ndtr

from lic_drake.clutter.board import ApertureBoard
from lic_drake.perception.board_grid import BoardGrid, fit_grid
from lic_drake.perception.board_plane import BoardPlane, find_board_plane
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import pose_covariance
from lic_drake.types import Vector

STATES = ("open", "partly", "blocked", "unseen")
"""States of an aperture."""

NEAR_M = 0.03
"""Points at most this far behind the board's front cover it; those further in front occlude it."""

OPEN_SHARE, BLOCKED_SHARE = 0.15, 0.85
"""An aperture is open, or blocked, if less, or more, than this share of it is covered."""

MIN_SEEN = 0.5
"""An aperture of which a smaller share is seen is "unseen"."""

EDGE_M = 0.005
"""Margin at the edges of an opening that is not evaluated, metres."""

MEASURED_SHARE = 0.4
"""A pixel without depth is a gap in a surface if more than this share around it has depth: near a
straight edge of the wood it is less outside and more inside."""

_RESOLUTION_M = 0.0025
_SAMPLES = 60
_GAP_PX = 5


@dataclass(frozen=True, kw_only=True)
class DetectedApertures:
    """The apertures of a board, row by row from below, each row from its right to its left.

    Attributes:
        p_WA: Centres, in the middle of the board, shape (n, 3), metres.
        covariance: Of the centres, shape (n, 3, 3), m^2.
        corners: Corners of the openings at the front of the board, shape (n, 4, 3), metres.
        covered: Covered share of the visible part of each opening, shape (n,).
        seen: Visible share of each opening, shape (n,).
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
    image: CameraImage, camera: CameraConfig, board: ApertureBoard
) -> DetectedApertures:
    """Locates the board and measures how far each of its apertures is covered.

    Bars are assumed to be as thick as they are wide, because only their fronts are visible.

    Args:
        image: What the camera sees.
        camera: Gives the errors of depths and of the camera's pose.
        board: Gives rows, columns and spacing, which is all that is known beforehand.

    Raises:
        PerceptionError: No such board is in view.
    """
    view = _BoardView(image, find_board_plane(image, camera))
    # Covers do not lie quite in the plane of the bars' fronts, so the plane is fitted to the bars.
    view = _BoardView(image, view.plane.shifted(view.depth_of_bars(view.fit(board))))
    grid = view.fit(board)
    clear = board.aperture_m - grid.bar_m
    centres = grid.cell_centres()
    values = view.sample(grid.to_plane(_visible_points(centres, clear, grid, view.plane.p_BC)))
    known = np.isfinite(values)
    seen = known.mean(axis=1)
    covered = np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    corner = 0.5 * clear * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    p_WA = view.to_world(grid.to_plane(centres), 0.5 * grid.bar_m)
    pixel_m = view.plane.p_CO[2] / image.focal_px
    return DetectedApertures(
        p_WA=p_WA,
        covariance=np.array(
            [
                view.covariance(grid, centre) + pose_covariance(p - image.p_WC, camera.pose_error)
                for centre, p in zip(centres, p_WA, strict=True)
            ]
        ),
        corners=view.to_world(grid.to_plane(centres[:, np.newaxis] + corner)),
        covered=covered,
        seen=seen,
        probability_open=_probability_open(covered, seen, pixel_m / clear),
    )


class _BoardView:
    """An image in which the plane of the board is known."""

    def __init__(self, image: CameraImage, plane: BoardPlane) -> None:
        self.image, self.plane = image, plane
        self._behind = plane.depth_behind(image)
        self._covers = _covers(self._behind)

    def fit(self, board: ApertureBoard) -> BoardGrid:
        """Returns the grid of bars."""
        eye = self.plane.p_BC * [-1.0, 1.0, 1.0]
        return fit_grid(
            lambda y, z: self.sample(np.stack([y, z], axis=-1)),
            board,
            self._extent(),
            eye,
            _RESOLUTION_M,
        )

    def depth_of_bars(self, grid: BoardGrid) -> float:
        """Returns how far behind the plane the fronts of the bars are, metres."""
        behind = self._pixels(self._behind, grid.to_plane(grid.bar_points(_RESOLUTION_M)))
        behind = behind[np.abs(behind) < NEAR_M]
        return float(np.mean(behind)) if len(behind) else 0.0

    def sample(self, at: Vector) -> Vector:
        """Returns 1 where points (y, z) of the plane are covered, 0 where not, NaN if unseen."""
        return self._pixels(self._covers, at)

    def to_world(self, at: Vector, behind_m: float = 0.0) -> Vector:
        """Returns p_WQ of points (y, z) in the plane, or that far behind it, metres."""
        return np.asarray(self.image.p_WC + self.plane.to_camera(at, behind_m) @ self.image.R_WC.T)

    def covariance(self, grid: BoardGrid, centre: Vector) -> Vector:
        """Returns the covariance of a centre by the errors of the image, shape (3, 3), m^2."""
        R_WB = self.image.R_WC @ self.plane.R_CB
        in_B = np.zeros((3, 3))
        in_B[0, 0] = self.plane.sigma_m**2 + 0.25 * grid.covariance[3, 3]
        in_B[1:, 1:] = grid.covariance_at(centre)
        return np.asarray(R_WB @ in_B @ R_WB.T)

    def _pixels(self, values: Vector, at: Vector) -> Vector:
        """Returns the values of the pixels that show points of the plane; NaN out of view."""
        p_CQ = self.plane.to_camera(at)
        column, row = np.moveaxis(self.image.project_from_camera(p_CQ), -1, 0)
        nearest = map_coordinates(values, [row, column], order=0, cval=np.nan)
        return np.where(p_CQ[..., 2] > 0.0, nearest, np.nan)

    def _extent(self) -> Vector:
        """Returns least and greatest (y, z) in the plane of what is covered, shape (2, 2)."""
        plane = self.plane
        rays = self.image.rays()[self._covers == 1.0]
        scale = (plane.p_CO @ plane.R_CB[:, 0]) / (rays @ plane.R_CB[:, 0])
        p_BQ = (rays * scale[:, np.newaxis] - plane.p_CO) @ plane.R_CB[:, 1:]
        return np.array([p_BQ.min(axis=0), p_BQ.max(axis=0)])


def _covers(behind: Vector) -> Vector:
    """Returns 1 for pixels that show the board or a cover, 0 behind them, NaN in front of them."""
    near = np.where(np.isnan(behind), 0.0, behind < NEAR_M)
    measured = np.isfinite(behind).astype(float)
    # Wood and covers have only scattered gaps in their depth. Larger gaps are out of the camera's
    # range, hence open.
    near_around, measured_around = (uniform_filter(x, _GAP_PX) for x in (near, measured))
    gap = (near_around > 0.5 * measured_around) & (measured_around > MEASURED_SHARE)
    return np.where(behind < -NEAR_M, np.nan, np.where(np.isnan(behind), gap, near))


def _visible_points(centres: Vector, clear: float, grid: BoardGrid, p_BC: Vector) -> Vector:
    """Returns points of the openings that the camera sees past the bars.

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
    return np.asarray(low[:, np.newaxis] + shares * (high - low)[:, np.newaxis])


def _probability_open(covered: Vector, seen: Vector, edge_share: float) -> Vector:
    """Returns the probability that less than `OPEN_SHARE` of an opening is covered.

    A share is uncertain by a pixel along each side, and by half a pixel's noise. The unseen part of
    an aperture is covered with probability one half.

    Args:
        covered: Covered share of the visible part, shape (n,).
        seen: Visible share, shape (n,).
        edge_share: Width of a pixel, as a share of the opening's.
    """
    sigma = np.hypot(2.0 * edge_share, 0.02)
    least = covered * seen
    bounds = (least, least + 1.0 - seen)
    return np.asarray(0.5 * sum(ndtr((OPEN_SHARE - share) / sigma) for share in bounds))
