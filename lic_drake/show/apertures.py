"""Maps of the estimated probability of success through each aperture (paper Fig. 2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from matplotlib.patheffects import withStroke

from lic_drake.evaluate.trial import Attempt
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessObjective
from lic_drake.select.situation import Situation
from lic_drake.show.figures import attempts_figure, estimate_title, situation_before
from lic_drake.starts import BoardStarts
from lic_drake.types import Vector

CORNERS = 0.5 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
"""Corners of a square of edge 1 around its centre."""


def apertures_figure(
    selector: LicSelector, starts: BoardStarts, attempts: Sequence[Attempt]
) -> Figure:
    """Returns a map of a known board, as a selector estimates it, before each attempt of a trial.

    The attempts may be another strategy's.
    """

    def draw(ax: Axes, number: int) -> None:
        attempt, situation = attempts[number - 1], situation_before(attempts, number, starts)
        values = estimate_apertures(selector.objective(situation), situation)
        chosen = nearest_aperture(starts, attempt)
        draw_aperture_map(ax, starts, values, situation.p_WG, chosen)
        ax.set_title(estimate_title(selector, number, attempt), fontsize=10)

    return attempts_figure(len(attempts), 6.0, draw)


def estimate_apertures(objective: SuccessObjective, situation: Situation) -> Vector:
    """Returns the highest estimate over base and torso at each open aperture, `starts.p_WA`.

    It includes the probability that the aperture is open. NaN where there is no feasible start away
    from those that failed.
    """
    starts = situation.starts
    assert isinstance(starts, BoardStarts)
    grid = starts.grid.take(situation.allowed(starts.grid))
    values = np.clip(objective.values(grid), 0.0, 1.0) * starts.chance(grid.x0)
    best = np.full(len(starts.p_WA), np.nan)
    for i, p_WA in enumerate(starts.p_WA):
        here = np.all(np.isclose(grid.x0[:, :3], p_WA), axis=1)
        if np.any(here):
            best[i] = values[here].max()
    return best


def nearest_aperture(starts: BoardStarts, attempt: Attempt) -> int:
    """Returns the index in `starts.p_WA` of the aperture that an attempt went through."""
    return int(np.argmin(np.linalg.norm(starts.p_WA - attempt.request.start.x0[:3], axis=1)))


def draw_aperture_map(
    ax: Axes,
    starts: BoardStarts,
    probability: Vector,
    p_WG: Vector,
    chosen: int | None = None,
) -> Axes:
    """Draws the board's open apertures as the robot sees them: its left is on the left.

    `probability` is what `estimate_apertures` returns; the aperture of index `chosen` is framed.
    """
    edge = starts.board.aperture_m
    outlines = starts.p_WA[:, np.newaxis, 1:] + edge * CORNERS
    draw_probabilities(ax, outlines, probability, chosen)
    ax.add_patch(Circle((p_WG[1], p_WG[2]), 0.02, fc="tab:cyan", ec="k"))
    centres = starts.board.aperture_centres()[:, 1:]
    low, high = centres.min(axis=0) - edge, centres.max(axis=0) + edge
    ax.set(xlim=(high[0], low[0]), ylim=(low[1], high[1]), aspect="equal", facecolor="burlywood")
    ax.set(xlabel="y [m]", ylabel="z [m]")
    return ax


def draw_probabilities(
    ax: Axes, outlines: Vector, probability: Vector, chosen: int | None = None
) -> None:
    """Fills apertures, outlines of shape (n, 4, 2): the brighter, the likelier is success.

    A NaN, where the arm cannot reach through, is drawn as 0 without a number.
    """
    for outline, value in zip(outlines, probability, strict=True):
        shade = colormaps["gray"](np.nan_to_num(value))
        ax.add_patch(Polygon(outline, closed=True, facecolor=shade, edgecolor="0.3", alpha=0.9))
        if not np.isnan(value):
            write(ax, outline.mean(axis=0), f"{value:.2f}", "black" if value > 0.5 else "white")
    if chosen is not None:
        ax.add_patch(Polygon(outlines[chosen], closed=True, fill=False, ec="tab:cyan", lw=2.5))


def write(ax: Axes, at: Vector, text: str, color: str) -> None:
    """Writes centred, outlined text at a point of the axes, shape (2,)."""
    around = withStroke(linewidth=2.0, foreground="black" if color == "white" else "white")
    x, y = at
    middle = {"ha": "center", "va": "center"}
    ax.text(x, y, text, middle, color=color, fontsize=7, weight="bold", path_effects=[around])
