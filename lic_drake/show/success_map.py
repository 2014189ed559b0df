"""Where a hand may start, and how likely a reach from there succeeds, as coloured marks in W."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Situation
from lic_drake.types import Vector

# A planar mark is an arrow of this length, metres; a mark in space leaves the middle of an aperture
# free for the hand.
_ARROW_M, _INNER = 0.08, 0.65
_LARGEST_MARK_M, _UNKNOWN = 0.09, (0.6, 0.6, 0.6)
_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


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
