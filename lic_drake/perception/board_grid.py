"""Fits the grid of a board's bars to a picture of the board seen straight from the front.

The board is located by correlation with a template, then refined by least squares on the edges of
its bars. Where a bar's side is visible next to its front, the wood appears to end only behind that
side; bars are assumed to be as thick as they are wide.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import correlate

from lic_drake.clutter.board import ApertureBoard
from lic_drake.errors import PerceptionError
from lic_drake.types import Vector

FIRST_BAR_SHARE = 0.1
"""Initial guess of the bars' width, as a share of the aperture spacing."""

MIN_MATCH = 0.5
"""Least score of the template: share of the bars that is seen less share of wood around."""

GATE_M = 0.02
"""Edges further than this from an expected bar edge are ignored, metres."""

MIN_EDGES = 50
"""Least number of edge points of upright, and of level, bars."""

_CORRELATED = 20
"""Edge points along a line of pixels that count as one: they share their rounding error."""


@dataclass(frozen=True, kw_only=True)
class BoardGrid:
    """Where the bars are in the board's plane, (y, z) from the plane's origin.

    Attributes:
        board: Gives rows, columns and spacing only; the rest is measured.
        centre: The board's centre, shape (2,), metres.
        angle: Rotation of the board in its plane, from y to z, radians.
        bar_m: Width of the bars, metres.
        covariance: Of centre, angle and bar_m, shape (4, 4).
    """

    board: ApertureBoard
    centre: Vector
    angle: float
    bar_m: float
    covariance: Vector

    def cell_centres(self) -> Vector:
        """Returns the apertures' centres in the board's own axes, shape (n, 2), metres."""
        y, z = (np.arange(n) - 0.5 * (n - 1) for n in _counts(self.board))
        return self.board.aperture_m * np.array([[yi, zi] for zi in z for yi in y])

    def bar_points(self, step_m: float) -> Vector:
        """Returns points on the middle lines of the bars, in the board's own axes, shape (n, 2)."""
        half = 0.5 * self.board.aperture_m * _counts(self.board)
        lines = [np.linspace(-h, h, n + 1) for h, n in zip(half, _counts(self.board), strict=True)]
        along = [np.arange(-h, h, step_m) for h in half]
        upright = np.stack(np.meshgrid(lines[0], along[1]), axis=-1).reshape(-1, 2)
        level = np.stack(np.meshgrid(along[0], lines[1]), axis=-1).reshape(-1, 2)
        return np.vstack([upright, level])

    def to_plane(self, at: Vector) -> Vector:
        """Returns points in the plane from points of the board, both shape (.., 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return np.asarray(self.centre + at @ np.array([[c, s], [-s, c]]))

    def to_board(self, at: Vector) -> Vector:
        """Returns points of the board from points in the plane, both shape (.., 2)."""
        return _to_board(np.append(self.centre, self.angle), at)

    def covariance_at(self, at: Vector) -> Vector:
        """Returns the covariance of a point of the board, shape (2, 2), m^2."""
        jacobian = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]]])
        return np.asarray(jacobian @ self.covariance[:3, :3] @ jacobian.T)


def fit_grid(
    look: Callable[[Vector, Vector], Vector],
    board: ApertureBoard,
    extent: Vector,
    eye: Vector,
    resolution_m: float,
) -> BoardGrid:
    """Finds the grid of bars.

    Args:
        look: Returns for points (y, z) of the plane 1 where there is wood or a cover, 0 where there
            is neither, NaN where they are not seen.
        board: Gives rows, columns and spacing, which is all that is known beforehand.
        extent: Where to look: least and greatest (y, z), shape (2, 2), metres.
        eye: The camera's distance from the plane and its (y, z), shape (3,), metres.
        resolution_m: Distance of the points at which to look, metres.

    Raises:
        PerceptionError: No such grid was found.
    """
    size = _counts(board) * board.aperture_m
    # Leaves room for a board that is partly out of view, and for its surroundings.
    margin = np.maximum(size - (extent[1] - extent[0]), 0.0) + board.aperture_m
    y, z = (
        np.arange(low, high, resolution_m)
        for low, high in zip(extent[0] - margin, extent[1] + margin, strict=True)
    )
    seen = look(*np.meshgrid(y, z))
    template = _template(size, board.aperture_m, resolution_m)
    match = correlate(np.nan_to_num(seen, nan=0.0), template, mode="valid", method="fft")
    if match.max() < MIN_MATCH:
        raise PerceptionError(
            f"no board of {board.rows} x {board.columns} apertures of {board.aperture_m} m in view:"
            f" the best match scores {match.max():.2f}, at least {MIN_MATCH} is needed"
        )
    row, column = np.unravel_index(np.argmax(match), match.shape)
    half = 0.5 * (np.array(template.shape[::-1]) - 1.0)
    first = np.array([y[0], z[0]]) + resolution_m * (np.array([column, row]) + half)
    edges = _edges(seen, y, z)
    guess = np.array([*first, 0.0, FIRST_BAR_SHARE * board.aperture_m])
    for _ in range(2):  # The second time with gates around the first result.
        guess, covariance = _refine(guess, edges, board, eye)
    return BoardGrid(
        board=board,
        centre=guess[:2],
        angle=float(guess[2]),
        bar_m=float(guess[3]),
        covariance=covariance,
    )


def _counts(board: ApertureBoard) -> Vector:
    """Returns the numbers of apertures across and up, shape (2,)."""
    return np.array([board.columns, board.rows])


def _template(size: Vector, aperture_m: float, resolution_m: float) -> Vector:
    """Returns weights: positive on bars, negative around the board, 0 in apertures."""
    bar = FIRST_BAR_SHARE * aperture_m
    reach = 0.5 * size + 0.5 * aperture_m
    steps = [np.arange(-n, n + 1) * resolution_m for n in np.round(reach / resolution_m)]
    at = np.stack(np.meshgrid(*steps), axis=-1)
    outside = np.any(np.abs(at) > 0.5 * (size + bar), axis=-1)
    from_line = np.abs((at + 0.5 * size + 0.5 * aperture_m) % aperture_m - 0.5 * aperture_m)
    bars = np.any(from_line <= 0.5 * bar, axis=-1) & ~outside
    return np.asarray(bars / np.count_nonzero(bars) - outside / np.count_nonzero(outside))


def _edges(seen: Vector, y: Vector, z: Vector) -> tuple[Vector, Vector]:
    """Returns edges along y, and along z: (y, z, -1 where wood begins and 1 where it ends)."""
    half_step = 0.5 * (y[1] - y[0])
    found = []
    for axis in (1, 0):
        step = np.diff(seen, axis=axis)  # NaN next to what is not seen.
        row, column = np.nonzero(np.abs(step) == 1.0)
        offset = (half_step, 0.0) if axis == 1 else (0.0, half_step)
        found.append(
            np.column_stack([y[column] + offset[0], z[row] + offset[1], -step[row, column]])
        )
    return found[0], found[1]


def _refine(
    guess: Vector, edges: tuple[Vector, Vector], board: ApertureBoard, eye: Vector
) -> tuple[Vector, Vector]:
    """Returns centre, angle and bar width by the edges near a guess, and their covariance."""
    lines: list[Vector] = []
    sides: list[Vector] = []
    points: list[Vector] = []
    for axis, (found, count) in enumerate(zip(edges, _counts(board), strict=True)):
        at = _to_board(guess, found[:, :2])
        bars = board.aperture_m * (np.arange(count + 1, dtype=np.float64) - 0.5 * count)
        nearest = np.argmin(np.abs(at[:, axis, np.newaxis] - bars), axis=1)
        off = at[:, axis] - _seen_edges(guess, bars[nearest], found[:, 2], eye, axis)
        # Near crossings the edges belong to the other bar.
        across, other_count = at[:, 1 - axis], _counts(board)[1 - axis]
        in_cell = (across / board.aperture_m + 0.5 * other_count) % 1.0
        within = np.abs(across) < 0.5 * board.aperture_m * other_count
        good = (np.abs(off) < GATE_M) & (np.abs(in_cell - 0.5) < 0.4) & within
        lines.append(bars[nearest][good])
        sides.append(found[good, 2])
        points.append(found[good, :2])
    if min(map(len, points)) < MIN_EDGES:
        raise PerceptionError(
            f"too little of the board is visible: {len(points[0])} edge points of upright and"
            f" {len(points[1])} of level bars, at least {MIN_EDGES} of each are needed"
        )

    def residuals(x: Vector) -> Vector:
        return np.concatenate(
            [
                _to_board(x, points[axis])[:, axis]
                - _seen_edges(x, lines[axis], sides[axis], eye, axis)
                for axis in (0, 1)
            ]
        )

    fit = least_squares(residuals, guess, loss="soft_l1", f_scale=0.002)
    spread = float(np.mean(np.minimum(np.abs(residuals(fit.x)), GATE_M) ** 2))
    return fit.x, _CORRELATED * spread * np.linalg.inv(fit.jac.T @ fit.jac)


def _seen_edges(x: Vector, line: Vector, side: Vector, eye: Vector, axis: int) -> Vector:
    """Returns where bars appear to end, projected onto the front of the board.

    Args:
        x: Centre, angle and bar width.
        line: Middle lines of the bars, shape (n,), metres.
        side: 1 for the upper or left edge of a bar, -1 for the other, shape (n,).
        eye: See `fit_grid`.
        axis: 0 for upright bars, 1 for level ones.
    """
    front = line + 0.5 * side * x[3]
    to_eye = _to_board(x, eye[np.newaxis, 1:])[0, axis] - front
    hidden = np.where(to_eye * side > 0.0, to_eye * x[3] / (eye[0] + x[3]), 0.0)
    return np.asarray(front + hidden)


def _to_board(x: Vector, at: Vector) -> Vector:
    """Returns points of the board from points in the plane, both shape (.., 2)."""
    c, s = np.cos(x[2]), np.sin(x[2])
    return np.asarray((at - x[:2]) @ np.array([[c, -s], [s, c]]))
