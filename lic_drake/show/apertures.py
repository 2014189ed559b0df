"""The estimated probability of success through each aperture of a board (paper Fig. 2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from lic_drake.evaluate.trial import Attempt
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessObjective
from lic_drake.show.figures import estimate_title, situations
from lic_drake.starts import BoardStarts
from lic_drake.types import Vector


def apertures_figure(
    selector: LicSelector, starts: BoardStarts, attempts: Sequence[Attempt]
) -> Figure:
    """Returns a map before each attempt.

    Args:
        selector: Whose estimates to draw; the attempts may be another strategy's.
        starts: The feasible starts.
        attempts: The attempts, all but the last one failures.
    """
    figure = Figure(figsize=(6.5 * len(attempts), 4.5))
    axes = figure.subplots(1, len(attempts), squeeze=False)[0]
    before = situations(attempts, [starts] * len(attempts))
    for ax, (number, attempt, situation) in zip(axes, before, strict=True):
        values = estimate_apertures(selector.objective(situation), starts)
        chosen = attempt.request.start.x0[:3]
        draw_aperture_map(ax, starts, values, situation.p_WG, [(f"attempt {number}", chosen)])
        ax.set_title(estimate_title(selector, number, attempt), fontsize=10)
    return figure


def estimate_apertures(objective: SuccessObjective, starts: BoardStarts) -> Vector:
    """Returns the highest estimate over base and torso at each open aperture, shape (k,).

    It includes the probability that the aperture is open. NaN where there is no feasible start.

    Args:
        objective: What is estimated.
        starts: The feasible starts; the apertures are `starts.p_WA`.
    """
    values = np.clip(objective.values(starts.grid), 0.0, 1.0) * starts.chance(starts.grid.x0)
    best = np.full(len(starts.p_WA), np.nan)
    for i, p_WA in enumerate(starts.p_WA):
        here = np.all(np.isclose(starts.grid.x0[:, :3], p_WA), axis=1)
        if np.any(here):
            best[i] = values[here].max()
    return best


def draw_aperture_map(
    ax: Axes,
    starts: BoardStarts,
    probability: Vector,
    p_WG: Vector,
    chosen: Sequence[tuple[str, Vector]] = (),
) -> Axes:
    """Draws the board as the robot sees it: its left is on the left.

    Args:
        ax: Where to draw.
        starts: Gives the apertures, open and blocked.
        probability: Estimates for the open ones, shape (k,).
        p_WG: Goal, shape (3,), metres.
        chosen: Labels and centres of apertures that were chosen.
    """
    image, edge = None, starts.board.aperture_m
    half = 0.5 * edge
    highest = max(0.01, float(np.nanmax(probability, initial=0.0)))
    for p in starts.board.aperture_centres():
        y, z = p[1:]
        is_here = np.all(np.isclose(starts.p_WA, p), axis=1)
        if not np.any(is_here):
            corner = (y - half, z - half)
            ax.add_patch(Rectangle(corner, edge, edge, fc="0.75", ec="0.4", hatch="xx"))
            continue
        value = probability[is_here][0]
        sides = [y - half, y + half], [z - half, z + half]
        image = ax.pcolormesh(
            *sides, [[value]], vmin=0.0, vmax=highest, cmap="RdYlGn", edgecolors="0.4"
        )
        # The number makes room for the goal.
        near = np.max(np.abs(p_WG[1:] - p[1:])) < half
        aside = (0.55 * half if p_WG[2] < z else -0.35 * half) if near else 0.0
        text = "-" if np.isnan(value) else f"{100 * value:.0f} %"
        ax.text(y, z + aside, text, ha="center", va="center", fontsize=9)
    for label, (_, y, z) in chosen:
        corner, inner = (y - half + 0.008, z - half + 0.008), edge - 0.016
        ax.add_patch(Rectangle(corner, inner, inner, fill=False, ec="tab:blue", lw=2.5))
        ax.text(y, z - 0.7 * half, label, ha="center", fontsize=7, color="tab:blue")
    ax.add_patch(Circle((p_WG[1], p_WG[2]), 0.02, fc="tab:cyan", ec="k", zorder=5))
    if image is not None and ax.figure is not None:
        ax.figure.colorbar(image, ax=ax, label="estimated probability of success")
    ax.set(xlabel="y [m]", ylabel="z [m]", aspect="equal")
    ax.invert_xaxis()
    return ax
