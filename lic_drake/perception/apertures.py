"""Finds a board's apertures in an image and classifies them as open or closed (paper V-B)."""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from lic_drake.clutter.board import ApertureBoard
from lic_drake.perception.board import BoardView, locate_board, to_grid, to_plane
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage, pose_covariance
from lic_drake.types import Vector

STATES = ("open", "partly", "blocked", "unseen")
"""States of an aperture."""
OPEN_SHARE, BLOCKED_SHARE = 0.15, 0.85
"""An aperture is open, or blocked, if less, or more, than this share of it is covered."""
MIN_SEEN = 0.5
"""An aperture of which a smaller share is seen is "unseen"."""
EDGE_M = 0.005
"""Margin at the edges of an opening that is not evaluated, metres."""

_SAMPLES = 60


@dataclass(frozen=True, kw_only=True)
class DetectedApertures:
    """The apertures of a board, row by row from below, each row from its right to its left.

    Attributes:
        p_WA: Centres, in the middle of the board, shape (n, 3), metres.
        covariance: Of the centres, shape (n, 3, 3), m^2.
        corners: Corners of the openings at the front of the board, shape (n, 4, 3), metres.
        states: Each aperture's state, one of `STATES`.
        probability_open: Probability that an aperture is open, shape (n,).
    """

    p_WA: Vector
    covariance: Vector
    corners: Vector
    states: tuple[str, ...]
    probability_open: Vector


def find_apertures(
    image: CameraImage, camera: CameraConfig, board: ApertureBoard
) -> DetectedApertures:
    """Locates the board and measures how far each of its apertures is covered.

    Of the board only rows, columns and spacing are known beforehand; `camera` gives the errors of
    depths and of the camera's pose.

    Raises:
        PerceptionError: No such board is in view.
    """
    view, pose, grid_covariance = locate_board(image, camera, board)
    bar_m = pose[3]
    clear = board.aperture_m - bar_m
    y, z = (np.arange(n) - 0.5 * (n - 1) for n in (board.columns, board.rows))
    centres = board.aperture_m * np.array([[yi, zi] for zi in z for yi in y])
    values = view.sample(
        to_plane(pose, _visible_points(centres, board.aperture_m, pose, view.p_BC))
    )
    known = np.isfinite(values)
    seen = known.mean(axis=1)
    covered = np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    by_share = np.digitize(covered, [OPEN_SHARE, BLOCKED_SHARE])
    states = np.where(seen < MIN_SEEN, STATES.index("unseen"), by_share)
    corner = 0.5 * clear * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    p_WA = view.to_world(to_plane(pose, centres), 0.5 * bar_m)
    pixel_m = view.p_CO[2] / image.focal_px
    return DetectedApertures(
        p_WA=p_WA,
        covariance=np.array(
            [
                _covariance(view, grid_covariance, centre)
                + pose_covariance(p - image.p_WC, camera.pose_error)
                for centre, p in zip(centres, p_WA, strict=True)
            ]
        ),
        corners=view.to_world(to_plane(pose, centres[:, np.newaxis] + corner)),
        states=tuple(STATES[state] for state in states),
        probability_open=_probability_open(covered, seen, pixel_m / clear),
    )


def _covariance(view: BoardView, grid_covariance: Vector, centre: Vector) -> Vector:
    """Returns the covariance of an aperture's centre by the errors of the image, (3, 3), m^2."""
    R_WB = view.image.R_WC @ view.R_CB
    jacobian = np.array([[1.0, 0.0, -centre[1]], [0.0, 1.0, centre[0]]])
    in_B = np.zeros((3, 3))
    in_B[0, 0] = view.sigma_m**2 + 0.25 * grid_covariance[3, 3]
    in_B[1:, 1:] = jacobian @ grid_covariance[:3, :3] @ jacobian.T
    return np.asarray(R_WB @ in_B @ R_WB.T)


def _visible_points(centres: Vector, aperture_m: float, pose: Vector, p_BC: Vector) -> Vector:
    """Returns points that the camera sees past the bars, in openings with centres (n, 2).

    Their shape is (n, `_SAMPLES`^2, 2), metres, in the grid's own axes.
    """
    bar_m = pose[3]
    clear = aperture_m - bar_m
    eye = to_grid(pose, p_BC[1:])
    hidden = bar_m / (bar_m - p_BC[0])
    low, high = centres - 0.5 * clear, centres + 0.5 * clear
    low = low + np.maximum(eye - low, 0.0) * hidden + EDGE_M
    high = high - np.maximum(high - eye, 0.0) * hidden - EDGE_M
    share = np.linspace(0.0, 1.0, _SAMPLES)
    shares = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
    return np.asarray(low[:, np.newaxis] + shares * (high - low)[:, np.newaxis])


def _probability_open(covered: Vector, seen: Vector, edge_share: float) -> Vector:
    """Returns the probability that less than `OPEN_SHARE` of an opening is covered.

    A share is uncertain by a pixel (`edge_share` of the width) along each side, and by half a
    pixel's noise. The unseen part of an aperture is covered with probability one half.
    """
    sigma = np.hypot(2.0 * edge_share, 0.02)
    least = covered * seen
    bounds = (least, least + 1.0 - seen)
    return np.asarray(0.5 * sum(ndtr((OPEN_SHARE - share) / sigma) for share in bounds))
