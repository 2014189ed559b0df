"""The estimated probability of success over a planar arm's starts (paper Fig. 6)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.start import Start, Starts
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
