"""Fits the grid of a board's bars to a picture of the board seen straight from the front."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import correlate

from lic_drake.errors import PerceptionError
from lic_drake.types import Vector

FIRST_BAR_SHARE = 0.1
"""Width of the bars, as a share of the apertures', that the search begins with."""

MIN_MATCH = 0.5
"""Share of the bars that has to be there, less the share of their surroundings that is wood too."""

GATE_M = 0.02
"""An edge further from where a bar's edge is expected is something else's."""

MIN_EDGES = 50
"""Fewer edge points than this are no board."""

_CORRELATED = 20
"""So many edge points along a line of pixels count as one: they share their rounding."""


@dataclass(frozen=True, kw_only=True)
class BoardGrid:
    """Where the bars are in the board's plane, (y, z) from the plane's origin.

    Attributes:
        rows: Number of rows of apertures.
        columns: Number of columns.
        aperture_m: Distance of neighbouring bars, metres.
        centre: The board's centre, shape (2,), metres.
        angle: How far the board is turned in its plane, from y to z, radians.
        bar_m: Width of the bars, metres.
        covariance: Of centre, angle and bar_m, shape (4, 4).
    """

    rows: int
    columns: int
    aperture_m: float
    centre: Vector
    angle: float
    bar_m: float
    covariance: Vector

    def cell_centres(self) -> Vector:
        """Returns the apertures' centres from the board's, before it is turned, shape (n, 2)."""
        y = self.aperture_m * (np.arange(self.columns) - 0.5 * (self.columns - 1))
        z = self.aperture_m * (np.arange(self.rows) - 0.5 * (self.rows - 1))
        return np.array([[yi, zi] for zi in z for yi in y])

    def bar_points(self, step_m: float) -> Vector:
        """Returns points on the middle lines of the bars, of the board, shape (n, 2)."""
        half = 0.5 * self.aperture_m * np.array([self.columns, self.rows])
        lines = [
            np.linspace(-h, h, n + 1) for h, n in zip(half, (self.columns, self.rows), strict=True)
        ]
        along = [np.arange(-h, h, step_m) for h in half]
        upright = np.stack(np.meshgrid(lines[0], along[1]), axis=-1).reshape(-1, 2)
        level = np.stack(np.meshgrid(along[0], lines[1]), axis=-1).reshape(-1, 2)
        return np.vstack([upright, level])

    def to_plane(self, at: Vector) -> Vector:
        """Returns points of the plane from points of the board, both shape (.., 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned: Vector = self.centre + at @ np.array([[c, s], [-s, c]])
        return turned

    def to_board(self, at: Vector) -> Vector:
        """Returns points of the board from points of the plane, both shape (.., 2)."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        turned: Vector = (at - self.centre) @ np.array([[c, -s], [s, c]])
        return turned

    def covariance_at(self, at: Vector) -> Vector:
        """Returns the covariance of a point of the board, shape (2, 2), m^2."""
        jacobian = np.array([[1.0, 0.0, -at[1]], [0.0, 1.0, at[0]]])
        covariance: Vector = jacobian @ self.covariance[:3, :3] @ jacobian.T
        return covariance


def fit_grid(
    look: Callable[[Vector, Vector], Vector],
    rows: int,
    columns: int,
    aperture_m: float,
    extent: Vector,
    eye: Vector,
    resolution_m: float,
) -> BoardGrid:
    """Finds the grid: roughly by its likeness to a template, then by the edges of its bars.

    Where a bar's side can be seen beside its front, wood seems to end only behind the side. Bars
    are taken to be as thick as they are wide.

    Args:
        look: Tells of points (y, z) of the plane whether there is wood or a cover (1), nothing
            (0), or whether they are not seen (NaN).
        rows: Number of rows of apertures.
        columns: Number of columns.
        aperture_m: Distance of neighbouring bars, metres.
        extent: Where to look: least and greatest (y, z), shape (2, 2), metres.
        eye: Where the camera is: its distance from the plane and its (y, z), shape (3,), metres.
        resolution_m: Distance of the points at which to look, metres.

    Raises:
        PerceptionError: There is no such grid.
    """
    size = np.array([columns, rows]) * aperture_m
    # Room for a board of which a part is not in view, and for its surroundings.
    margin = np.maximum(size - (extent[1] - extent[0]), 0.0) + aperture_m
    y, z = (
        np.arange(low, high, resolution_m)
        for low, high in zip(extent[0] - margin, extent[1] + margin, strict=True)
    )
    seen = look(*np.meshgrid(y, z))
    picture = np.nan_to_num(seen, nan=0.0)
    template = _template(size, aperture_m, resolution_m)
    match = correlate(picture, template, mode="valid", method="fft")
    if match.max() < MIN_MATCH:
        raise PerceptionError(
            f"no board of {rows} x {columns} apertures of {aperture_m} m in view: the best place"
            f" for it matches by {match.max():.2f}, at least {MIN_MATCH} is needed"
        )
    row, column = np.unravel_index(np.argmax(match), match.shape)
    half = 0.5 * (np.array(template.shape[::-1]) - 1.0)
    first = np.array([y[0], z[0]]) + resolution_m * (np.array([column, row]) + half)
    edges = _edges(seen, y, z)
    guess = np.array([*first, 0.0, FIRST_BAR_SHARE * aperture_m])
    # Twice: with the gates around the first guess, and around what came of it.
    for _ in range(2):
        guess, covariance = _refine(guess, edges, rows, columns, aperture_m, eye)
    return BoardGrid(
        rows=rows,
        columns=columns,
        aperture_m=aperture_m,
        centre=guess[:2],
        angle=float(guess[2]),
        bar_m=float(guess[3]),
        covariance=covariance,
    )


def _template(size: Vector, aperture_m: float, resolution_m: float) -> Vector:
    """Returns weights of a picture: bars count for a place, wood around the board against it.

    Apertures count for nothing, because they may be covered.
    """
    bar = FIRST_BAR_SHARE * aperture_m
    reach = 0.5 * size + 0.5 * aperture_m
    steps = [np.arange(-n, n + 1) * resolution_m for n in np.round(reach / resolution_m)]
    at = np.stack(np.meshgrid(*steps), axis=-1)
    outside = np.any(np.abs(at) > 0.5 * (size + bar), axis=-1)
    from_line = np.abs((at + 0.5 * size + 0.5 * aperture_m) % aperture_m - 0.5 * aperture_m)
    bars = np.any(from_line <= 0.5 * bar, axis=-1) & ~outside
    weights: Vector = bars / np.count_nonzero(bars) - outside / np.count_nonzero(outside)
    return weights


def _edges(seen: Vector, y: Vector, z: Vector) -> tuple[Vector, Vector]:
    """Returns edges along y, and along z: (y, z, -1 where wood begins and 1 where it ends)."""
    found = []
    for axis in (1, 0):
        step = np.diff(seen, axis=axis)  # NaN beside what is not seen.
        row, column = np.nonzero(np.abs(step) == 1.0)
        at_y, at_z = y[column], z[row]
        middle = 0.5 * (y[1] - y[0])
        if axis == 1:
            at_y = at_y + middle
        else:
            at_z = at_z + middle
        found.append(np.column_stack([at_y, at_z, -step[row, column]]))
    return found[0], found[1]


def _refine(
    guess: Vector,
    edges: tuple[Vector, Vector],
    rows: int,
    columns: int,
    aperture_m: float,
    eye: Vector,
) -> tuple[Vector, Vector]:
    """Returns centre, angle and bar width by the edges near a guess, and their covariance."""
    counts = (columns, rows)
    lines: list[Vector] = []
    sides: list[Vector] = []
    points: list[Vector] = []
    for axis, (found, count) in enumerate(zip(edges, counts, strict=True)):
        at = _to_board(guess, found[:, :2])
        bars = aperture_m * (np.arange(count + 1, dtype=np.float64) - 0.5 * count)
        nearest = np.argmin(np.abs(at[:, axis, np.newaxis] - bars), axis=1)
        expected = _seen_edges(guess, bars[nearest], found[:, 2], eye, axis)
        off = at[:, axis] - expected
        # Where bars cross there are no edges of this one.
        other = (at[:, 1 - axis] / aperture_m + 0.5 * counts[1 - axis]) % 1.0
        within = np.abs(at[:, 1 - axis]) < 0.5 * aperture_m * counts[1 - axis]
        good = (np.abs(off) < GATE_M) & (np.abs(other - 0.5) < 0.4) & within
        lines.append(bars[nearest][good])
        sides.append(found[good, 2])
        points.append(found[good, :2])
    if min(map(len, points)) < MIN_EDGES:
        raise PerceptionError(
            f"too little of the board is seen: {len(points[0])} points of edges of upright and"
            f" {len(points[1])} of level bars, {MIN_EDGES} of each are needed"
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
    """Returns where bars seem to end, projected onto the front of the board.

    Args:
        x: Centre, angle and bar width.
        line: Middle lines of the bars, shape (n,), metres.
        side: 1 for the upper or left edge of a bar, -1 for the other, shape (n,).
        eye: See `fit_grid`.
        axis: 0 for upright bars, 1 for level ones.
    """
    front = line + 0.5 * side * x[3]
    to_eye = _to_board(x, eye[np.newaxis, 1:])[0, axis] - front
    seen: Vector = front + np.where(to_eye * side > 0.0, to_eye * x[3] / (eye[0] + x[3]), 0.0)
    return seen


def _to_board(x: Vector, at: Vector) -> Vector:
    """Returns points of the board from points of the plane, both shape (n, 2)."""
    c, s = np.cos(x[2]), np.sin(x[2])
    turned: Vector = (at - x[:2]) @ np.array([[c, -s], [s, c]])
    return turned
