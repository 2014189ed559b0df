"""The estimated probability of success over starts: figures (paper Fig. 6), and marks in W."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from lic_drake.show.figures import (
    ATTEMPT_COLORS,
    attempts_figure,
    estimate_title,
    situation_before,
)
from lic_drake.starts import LineStarts, Region, find_regions
from lic_drake.types import Vector

DENSITY_SHAPE = (81, 91)
"""Lattice of a density: y every 1 cm, phi every 2 degrees."""

# A planar mark is an arrow of this length, metres; a mark in space leaves the middle of an aperture
# free for the hand.
_ARROW_M, _INNER = 0.08, 0.65
_LARGEST_MARK_M, _UNKNOWN = 0.09, (0.6, 0.6, 0.6)
_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def densities_figure(
    selector: LicSelector, starts: LineStarts, attempts: Sequence[Attempt]
) -> Figure:
    """Returns the estimates of a selector over all starts before each attempt of a trial.

    The attempts may be another strategy's.
    """

    def draw(ax: Axes, number: int) -> None:
        attempt, situation = attempts[number - 1], situation_before(attempts, number, starts)
        chosen = attempt.request.start
        region = starts.regions[find_regions(starts.regions, Starts.of(chosen))[0]]
        lattice = density_lattice(starts, region)
        draw_density(ax, lattice, estimate_density(selector, situation, lattice), chosen, number)
        ax.set_title(estimate_title(selector, number, attempt), fontsize=10)

    return attempts_figure(len(attempts), 7.0, draw)


def density_lattice(starts: LineStarts, region: Region) -> Starts:
    """Returns a lattice of starts over a start line, feasible or not; phi varies fastest.

    Where the base moves, the hand is in the centre of an aperture and the base varies; relative to
    the base these are the same poses. `region` is the line, or an aperture.
    """
    line = starts.line
    y = np.linspace(line.lower[1], line.upper[1], DENSITY_SHAPE[0])
    phi = np.linspace(line.lower[2], line.upper[2], DENSITY_SHAPE[1])
    poses = np.array([[line.x_m, yi, phi_i] for yi in y for phi_i in phi])
    b0 = np.zeros_like(poses)
    if region.lower[1] == region.upper[1]:
        b0[:, :2] = region.lower[:2] - poses[:, :2]
    return Starts(poses + b0, b0)


def estimate_density(selector: LicSelector, situation: Situation, lattice: Starts) -> Vector:
    """Returns the estimates at n starts, shape (n,), NaN where the arm cannot start."""
    arm = situation.starts.arm
    feasible = np.array([len(arm.solve_ik(x0)) > 0 for x0 in lattice.in_R])
    density = np.full(len(feasible), np.nan)
    values = selector.objective(situation).values(lattice.take(feasible))
    density[feasible] = np.clip(values, 0.0, 1.0)
    return density


def draw_density(
    ax: Axes, lattice: Starts, probability: Vector, chosen: Start, number: int = 1
) -> Axes:
    """Draws estimates over the n starts of a `density_lattice`, and the start that was selected.

    `probability` has shape (n,), NaN where the arm cannot start; `number` is that of the attempt.
    """
    y, phi = (lattice.in_R[:, k].reshape(DENSITY_SHAPE) for k in (1, 2))
    values = probability.reshape(DENSITY_SHAPE)
    image = ax.pcolormesh(y, phi, values, cmap="viridis", vmin=0.0, vmax=1.0, shading="nearest")
    color = ATTEMPT_COLORS[(number - 1) % len(ATTEMPT_COLORS)]
    (star,) = ax.plot(*chosen.x0_R[1:], "*", ms=16, color=color, label=f"attempt {number}")
    star.set(markeredgecolor="white", clip_on=False)
    ax.set(xlabel="start position y [m]", ylabel="start orientation φ [rad]", facecolor="0.9")
    ax.legend(loc="lower right", fontsize=8)
    if ax.figure is not None:
        ax.figure.colorbar(image, ax=ax, label="estimated probability of success")
    return ax


@dataclass(frozen=True, kw_only=True)
class SuccessMap:
    """The likeliest start at each of n hand positions.

    Attributes:
        starts: One for each position, with joint angles.
        probability: Estimated P(success), shape (n,); NaN where a start is ruled out, as it is too
            near to one that failed.
    """

    starts: Starts
    probability: Vector

    @property
    def best(self) -> Start | None:
        """The start with the highest estimate, None if all are ruled out."""
        if np.all(np.isnan(self.probability)):
            return None
        return self.starts[int(np.nanargmax(self.probability))]


class ColorMesh(NamedTuple):
    """Triangles in W: vertices (3, n), metres, faces (3, m), and colours (3, n) from 0 to 1."""

    vertices: Vector
    faces: NDArray[np.int32]
    colors: Vector


def map_success(selector: LicSelector, situation: Situation) -> SuccessMap:
    """Compares what the strategy compares first: the grid and, in the plane, the lattice.

    It takes milliseconds. `LicSelector.solve` goes on from there and finds slightly better starts.
    """
    starts, objective = situation.starts, selector.objective(situation)
    some = starts.grid
    values = objective.values(some)
    if starts.arm.is_planar:
        dense = starts.lattice(values)
        some, values = some.join(dense), np.append(values, objective.values(dense))
    values = np.clip(values, 0.0, 1.0) * starts.chance(some.x0)
    if not objective.failed:
        values[~situation.allowed(some)] = np.nan
    axes = 2 if some.x0.shape[1] == IN_PLANE else 3
    order = np.argsort(-np.nan_to_num(values, nan=-1.0), kind="stable")
    _, first = np.unique(some.x0[order, :axes].round(6), axis=0, return_index=True)
    return SuccessMap(starts=some.take(order[first]), probability=values[order[first]])


def mark_starts(found: SuccessMap) -> ColorMesh:
    """Returns a mark for each hand position: the brighter, the likelier is success.

    In the plane it is an arrow along the hand's best direction, in space the rim of an aperture.
    """
    x0, n = found.starts.x0, len(found.starts)
    colors = colormaps["viridis"](np.nan_to_num(found.probability))[:, :3]
    colors[np.isnan(found.probability)] = _UNKNOWN
    colors **= 2.2  # Meshcat takes the colours of vertices as linear.
    axes = 2 if x0.shape[1] == IN_PLANE else 3
    apart = np.linalg.norm(x0[:, None, :axes] - x0[None, :, :axes], axis=2)
    nearest = np.min(apart + np.diag(np.full(n, np.inf)), initial=np.inf)
    half = min(0.45 * nearest, _LARGEST_MARK_M)
    if axes == 2:
        along = np.column_stack([np.cos(x0[:, 2]), np.sin(x0[:, 2]), np.zeros(n)])
        across = min(half, 0.5 * _ARROW_M) * np.column_stack(
            [-along[:, 1], along[:, 0], np.zeros(n)]
        )
        tip = np.column_stack([x0[:, :2], np.zeros(n)])
        tail = tip - _ARROW_M * along
        corners = np.stack([tip, tail + across, tail - across], axis=1)
        faces = np.array([[0, 1, 2]])
    else:
        rim = half * np.vstack([_SQUARE, _INNER * _SQUARE])
        corners = x0[:, None, :3] + np.column_stack([np.zeros(8), rim])
        # Two triangles between an edge of the outer square and that of the inner one.
        ends = [(k, (k + 1) % 4) for k in range(4)]
        faces = np.array([t for a, b in ends for t in ((a, b, a + 4), (b, b + 4, a + 4))])
    count = corners.shape[1]
    shifted = faces[None] + count * np.arange(n)[:, None, None]
    return ColorMesh(
        vertices=corners.reshape(-1, 3).T,
        faces=shifted.reshape(-1, 3).T.astype(np.int32),
        colors=np.repeat(colors, count, axis=0).T,
    )
