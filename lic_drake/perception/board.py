"""Locates a board of apertures in a colour and depth image: its plane, then the grid of its bars.

The plane is fitted to brown pixels. In it, the board is located by correlation with a template, and
refined by least squares on the edges of its bars. Where a bar's side is visible next to its front,
the wood appears to end only behind that side; bars are assumed to be as thick as they are wide.
"""

import numpy as np
from scipy.ndimage import map_coordinates, uniform_filter
from scipy.optimize import least_squares
from skimage.color import rgb2hsv

from lic_drake.clutter.board import ApertureBoard
from lic_drake.errors import PerceptionError
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.image import CameraImage
from lic_drake.types import Vector

WOOD_HUE, WOOD_SATURATION = (0.04, 0.13), 0.2
"""Range of hues of the bars (between red and yellow), and their least saturation, 0 to 1."""
MIN_PIXELS, MAX_SAMPLES = 500, 20_000
"""Least number of brown pixels of a board in view, and largest number that is fitted."""
NEAR_M = 0.03
"""Points at most this far behind the board's front cover it; those further in front occlude it."""
MEASURED_SHARE = 0.4
"""A pixel without depth is a gap in a surface if more than this share around it has depth: near a
straight edge of the wood it is less outside and more inside."""
FIRST_BAR_SHARE = 0.1
"""Initial guess of the bars' width, as a share of the aperture spacing."""
MIN_MATCH = 0.5
"""Least score of the template: share of the bars that is seen less share of wood around."""
GATE_M = 0.02
"""Edges further than this from an expected bar edge are ignored, metres."""
MIN_EDGES = 50
"""Least number of edge points of upright, and of level, bars."""

_GAP_PX = 5
_RESOLUTION_M = 0.0025
_CORRELATED = (
    20  # Edge points along a line of pixels share their rounding error: they count as one.
)


class BoardView:
    """An image in which the plane of the board's front is known.

    Attributes:
        image: The image.
        p_CO: Where the optical axis meets the plane, shape (3,), metres.
        R_CB: Axes Bx away from the camera, across the board, By to its left and Bz up, shape
            (3, 3).
        p_BC: Position of the camera from O, in B, shape (3,), metres.
        sigma_m: Standard deviation of the plane's distance, metres.
    """

    def __init__(self, image: CameraImage, p_CO: Vector, R_CB: Vector, sigma_m: float) -> None:
        self.image, self.p_CO, self.R_CB, self.sigma_m = image, p_CO, R_CB, sigma_m
        self.p_BC = -p_CO @ R_CB
        self._behind = image.depth * (image.rays() @ R_CB[:, 0]) - p_CO @ R_CB[:, 0]
        near = np.where(np.isnan(self._behind), 0.0, self._behind < NEAR_M)
        measured = np.isfinite(self._behind).astype(float)
        # Wood and covers have only scattered gaps in their depth. Larger gaps are out of the
        # camera's range, hence open.
        near_around, measured_around = (uniform_filter(x, _GAP_PX) for x in (near, measured))
        gap = (near_around > 0.5 * measured_around) & (measured_around > MEASURED_SHARE)
        shown = np.where(np.isnan(self._behind), gap, near)
        self._covers = np.where(self._behind < -NEAR_M, np.nan, shown)

    def sample(self, at: Vector) -> Vector:
        """Returns 1 where points (y, z) of the plane are covered, 0 where not, NaN if unseen."""
        return self._pixels(self._covers, at)

    def to_world(self, at: Vector, behind_m: float = 0.0) -> Vector:
        """Returns p_WQ of points (y, z) in the plane, or that far behind it, metres."""
        return np.asarray(self.image.p_WC + self._to_camera(at, behind_m) @ self.image.R_WC.T)

    def covered_range(self) -> Vector:
        """Returns least and greatest (y, z) in the plane of what is covered, shape (2, 2)."""
        rays = self.image.rays()[self._covers == 1.0]
        scale = (self.p_CO @ self.R_CB[:, 0]) / (rays @ self.R_CB[:, 0])
        p_BQ = (rays * scale[:, np.newaxis] - self.p_CO) @ self.R_CB[:, 1:]
        return np.array([p_BQ.min(axis=0), p_BQ.max(axis=0)])

    def moved_to(self, at: Vector) -> "BoardView":
        """Returns the view with the plane moved to the mean depth of points (y, z) of it."""
        behind = self._pixels(self._behind, at)
        behind = behind[np.abs(behind) < NEAR_M]
        distance = float(np.mean(behind)) if len(behind) else 0.0
        p_CO = self.p_CO * (1.0 + distance / (self.p_CO @ self.R_CB[:, 0]))
        return BoardView(self.image, p_CO, self.R_CB, self.sigma_m)

    def _to_camera(self, at: Vector, behind_m: float = 0.0) -> Vector:
        p_BQ = np.concatenate([np.full((*at.shape[:-1], 1), behind_m), at], axis=-1)
        return np.asarray(self.p_CO + p_BQ @ self.R_CB.T)

    def _pixels(self, values: Vector, at: Vector) -> Vector:
        """Returns the values of the pixels that show points of the plane; NaN out of view."""
        p_CQ = self._to_camera(at)
        column, row = np.moveaxis(self.image.project_from_camera(p_CQ), -1, 0)
        nearest = map_coordinates(values, [row, column], order=0, cval=np.nan)
        return np.where(p_CQ[..., 2] > 0.0, nearest, np.nan)


def locate_board(
    image: CameraImage, camera: CameraConfig, board: ApertureBoard
) -> tuple[BoardView, Vector, Vector]:
    """Locates a board; see `find_apertures`.

    Returns:
        The board's plane; the pose of its grid, shape (4,): centre (y, z) from the plane's origin,
        metres, rotation in the plane from y to z, radians, and width of the bars, metres; the
        covariance of the pose, shape (4, 4).
    """
    view = _fit_plane(image, camera)
    # Covers do not lie quite in the plane of the bars' fronts, so the plane is fitted to the bars.
    pose, _ = _fit_grid(view, board)
    view = view.moved_to(to_plane(pose, _bar_points(board)))
    return view, *_fit_grid(view, board)


def to_plane(pose: Vector, at: Vector) -> Vector:
    """Returns points in the plane from points in the grid's own axes, both shape (.., 2)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(pose[:2] + at @ np.array([[c, s], [-s, c]]))


def to_grid(pose: Vector, at: Vector) -> Vector:
    """Returns points in the grid's own axes from points in the plane, both shape (.., 2)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray((at - pose[:2]) @ np.array([[c, -s], [s, c]]))


def _fit_plane(image: CameraImage, camera: CameraConfig) -> BoardView:
    """Finds the plane in which most of the brown pixels lie.

    In a plane the disparity 1/z is a linear function of the pixel, and its error is uniform.
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
    every = slice(None, None, -(-np.count_nonzero(brown) // MAX_SAMPLES))
    rays, disparity = image.rays()[brown][every, :2], 1.0 / image.depth[brown][every]
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
    R_CB = np.column_stack([n_C, np.cross(up_C, n_C), up_C])
    return BoardView(image, np.array([0.0, 0.0, z]), R_CB, sigma * z**2 / np.sqrt(inliers))


def _fit_grid(view: BoardView, board: ApertureBoard) -> tuple[Vector, Vector]:
    """Returns the pose of the grid of bars, and its covariance."""
    from scipy.signal import correlate  # Takes long to import, and most evaluations do without.

    extent, size = view.covered_range(), _counts(board) * board.aperture_m
    # Leaves room for a board that is partly out of view, and for its surroundings.
    margin = np.maximum(size - (extent[1] - extent[0]), 0.0) + board.aperture_m
    y, z = (
        np.arange(low, high, _RESOLUTION_M)
        for low, high in zip(extent[0] - margin, extent[1] + margin, strict=True)
    )
    seen = view.sample(np.stack(np.meshgrid(y, z), axis=-1))
    template = _template(size, board.aperture_m)
    match = correlate(np.nan_to_num(seen, nan=0.0), template, mode="valid", method="fft")
    if match.max() < MIN_MATCH:
        raise PerceptionError(
            f"no board of {board.rows} x {board.columns} apertures of {board.aperture_m} m in view:"
            f" the best match scores {match.max():.2f}, at least {MIN_MATCH} is needed"
        )
    row, column = np.unravel_index(np.argmax(match), match.shape)
    half = 0.5 * (np.array(template.shape[::-1]) - 1.0)
    first = np.array([y[0], z[0]]) + _RESOLUTION_M * (np.array([column, row]) + half)
    edges = _edges(seen, y, z)
    pose = np.array([*first, 0.0, FIRST_BAR_SHARE * board.aperture_m])
    pose, _ = _refine(pose, edges, board, view.p_BC)
    return _refine(pose, edges, board, view.p_BC)  # With gates around the first result.


def _counts(board: ApertureBoard) -> Vector:
    """Returns the numbers of apertures across and up, shape (2,)."""
    return np.array([board.columns, board.rows])


def _bar_points(board: ApertureBoard) -> Vector:
    """Returns points on the middle lines of the bars, in the grid's own axes, shape (n, 2)."""
    half = 0.5 * board.aperture_m * _counts(board)
    lines = [np.linspace(-h, h, n + 1) for h, n in zip(half, _counts(board), strict=True)]
    along = [np.arange(-h, h, _RESOLUTION_M) for h in half]
    grids = np.meshgrid(lines[0], along[1]), np.meshgrid(along[0], lines[1])
    return np.vstack([np.stack(grid, axis=-1).reshape(-1, 2) for grid in grids])


def _template(size: Vector, aperture_m: float) -> Vector:
    """Returns weights: positive on bars, negative around the board, 0 in apertures."""
    bar = FIRST_BAR_SHARE * aperture_m
    reach = 0.5 * size + 0.5 * aperture_m
    steps = [np.arange(-n, n + 1) * _RESOLUTION_M for n in np.round(reach / _RESOLUTION_M)]
    at = np.stack(np.meshgrid(*steps), axis=-1)
    outside = np.any(np.abs(at) > 0.5 * (size + bar), axis=-1)
    from_line = np.abs((at + 0.5 * size + 0.5 * aperture_m) % aperture_m - 0.5 * aperture_m)
    bars = np.any(from_line <= 0.5 * bar, axis=-1) & ~outside
    return np.asarray(bars / np.count_nonzero(bars) - outside / np.count_nonzero(outside))


def _edges(seen: Vector, y: Vector, z: Vector) -> list[Vector]:
    """Returns edges along y, and along z: (y, z, -1 where wood begins and 1 where it ends)."""
    half_step = 0.5 * (y[1] - y[0])
    found = []
    for axis, offset in ((1, (half_step, 0.0)), (0, (0.0, half_step))):
        step = np.diff(seen, axis=axis)  # NaN next to what is not seen.
        row, column = np.nonzero(np.abs(step) == 1.0)
        at = y[column] + offset[0], z[row] + offset[1]
        found.append(np.column_stack([*at, -step[row, column]]))
    return found


def _refine(
    guess: Vector, edges: list[Vector], board: ApertureBoard, p_BC: Vector
) -> tuple[Vector, Vector]:
    """Returns the pose of a grid by the edges near a guess, and its covariance."""
    kept: list[tuple[Vector, Vector, Vector]] = []  # Of each axis: points, lines, sides.
    counts = _counts(board)
    for axis, found in enumerate(edges):
        at = to_grid(guess, found[:, :2])
        bars = board.aperture_m * (np.arange(counts[axis] + 1.0) - 0.5 * counts[axis])
        nearest = np.argmin(np.abs(at[:, axis, np.newaxis] - bars), axis=1)
        off = at[:, axis] - _seen_edges(guess, bars[nearest], found[:, 2], p_BC, axis)
        # Near crossings the edges belong to the other bar.
        across, count = at[:, 1 - axis], counts[1 - axis]
        in_cell = (across / board.aperture_m + 0.5 * count) % 1.0
        within = np.abs(across) < 0.5 * board.aperture_m * count
        good = (np.abs(off) < GATE_M) & (np.abs(in_cell - 0.5) < 0.4) & within
        kept.append((found[good, :2], bars[nearest][good], found[good, 2]))
    upright, level = (len(points) for points, _, _ in kept)
    if min(upright, level) < MIN_EDGES:
        raise PerceptionError(
            f"too little of the board is visible: {upright} edge points of upright and"
            f" {level} of level bars, at least {MIN_EDGES} of each are needed"
        )

    def residuals(pose: Vector) -> Vector:
        return np.concatenate(
            [
                to_grid(pose, points)[:, axis] - _seen_edges(pose, lines, sides, p_BC, axis)
                for axis, (points, lines, sides) in enumerate(kept)
            ]
        )

    fit = least_squares(residuals, guess, loss="soft_l1", f_scale=0.002)
    spread = float(np.mean(np.minimum(np.abs(residuals(fit.x)), GATE_M) ** 2))
    return fit.x, _CORRELATED * spread * np.linalg.inv(fit.jac.T @ fit.jac)


def _seen_edges(pose: Vector, line: Vector, side: Vector, p_BC: Vector, axis: int) -> Vector:
    """Returns where bars appear to end, projected onto the front of the board.

    `line` are the bars' middle lines; `side` is 1 for the upper or left edge of a bar, -1 for the
    other; `axis` is 0 for upright bars, 1 for level ones.
    """
    front = line + 0.5 * side * pose[3]
    to_eye = to_grid(pose, p_BC[np.newaxis, 1:])[0, axis] - front
    hidden = np.where(to_eye * side > 0.0, to_eye * pose[3] / (pose[3] - p_BC[0]), 0.0)
    return np.asarray(front + hidden)
