"""The estimated probability of success through each aperture of a board (paper Fig. 2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.select.objective import SuccessObjective
from lic_drake.types import Vector


def estimate_apertures(objective: SuccessObjective, starts: PointingStarts) -> Vector:
    """Returns the highest estimate over base and torso at each open aperture, shape (k,).

    It is combined with the chance that the aperture is open, where that is not certain. NaN where
    the arm cannot start from anywhere.

    Args:
        objective: What is estimated.
        starts: The possible initial conditions; the apertures are `starts.p_WA`.
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
    p_WA: Vector,
    probability: Vector,
    all_p_WA: Vector,
    aperture_m: float,
    p_WG: Vector,
    chosen: Sequence[tuple[str, Vector]] = (),
) -> Axes:
    """Draws the board as the robot sees it: left is its left, up is up.

    Args:
        ax: Where to draw.
        p_WA: Centres of the open apertures, shape (k, 3), metres.
        probability: Their estimates, shape (k,).
        all_p_WA: Centres of all apertures, shape (n, 3), metres; others are drawn as blocked.
        aperture_m: Width of an aperture, metres.
        p_WG: Goal, shape (3,), metres.
        chosen: Labels and centres of apertures that were chosen.
    """
    image = None
    half = 0.5 * aperture_m
    for p in all_p_WA:
        open_here = np.flatnonzero(np.all(np.isclose(p_WA, p), axis=1))
        corner = (p[1] - half, p[2] - half)
        if len(open_here) == 0:
            blocked = Rectangle(corner, aperture_m, aperture_m, fc="0.75", ec="0.4", hatch="xx")
            ax.add_patch(blocked)
            continue
        value = probability[open_here[0]]
        image = ax.pcolormesh(
            [p[1] - half, p[1] + half],
            [p[2] - half, p[2] + half],
            [[value]],
            vmin=0.0,
            vmax=max(0.01, float(np.nanmax(probability))),
            cmap="RdYlGn",
            edgecolors="0.4",
        )
        text = "-" if np.isnan(value) else f"{100 * value:.0f} %"
        # Numbers give way to the goal.
        near = np.max(np.abs(p_WG[1:] - p[1:])) < half
        aside = (0.55 * half if p_WG[2] < p[2] else -0.35 * half) if near else 0.0
        ax.text(p[1], p[2] + aside, text, ha="center", va="center", fontsize=9)
    for label, p in chosen:
        frame = Rectangle(
            (p[1] - half + 0.008, p[2] - half + 0.008),
            aperture_m - 0.016,
            aperture_m - 0.016,
            fill=False,
            ec="tab:blue",
            lw=2.5,
        )
        ax.add_patch(frame)
        ax.text(p[1], p[2] - 0.7 * half, label, ha="center", fontsize=7, color="tab:blue")
    ax.add_patch(Circle((p_WG[1], p_WG[2]), 0.02, fc="tab:cyan", ec="k", zorder=5))
    if image is not None and ax.figure is not None:
        ax.figure.colorbar(image, ax=ax, label="estimated probability of success")
    ax.set(xlabel="y [m]", ylabel="z [m]", aspect="equal")
    ax.invert_xaxis()
    return ax
