"""Figures: functions that take data and an axis, draw, and return the axis."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import LicError
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.robots.planar import PlanarArm
from lic_drake.scene.looks import FIXED_COLOR, MOVABLE_COLOR
from lic_drake.types import Vector

ATTEMPT_COLORS = ("tab:blue", "tab:purple", "tab:green", "tab:olive", "tab:cyan")
"""Colours of the first and further attempts, over and over again."""


def draw_density(
    ax: Axes,
    x0: Vector,
    probability: Vector,
    shape: tuple[int, int],
    choices: Sequence[tuple[str, Vector]],
) -> Axes:
    """Draws the estimated probability of success over the start poses (paper Fig. 6).

    Args:
        ax: Where to draw.
        x0: Start poses of a lattice, (x, y, phi), shape (n, 3); phi varies fastest.
        probability: Estimates there, shape (n,); NaN where the arm cannot start.
        shape: Numbers of y and of phi values, n in all.
        choices: Chosen starts with their labels.
    """
    y = x0[:, 1].reshape(shape)
    phi = x0[:, 2].reshape(shape)
    image = ax.pcolormesh(
        y, phi, probability.reshape(shape), cmap="jet", vmin=0.0, vmax=1.0, shading="nearest"
    )
    for i, (label, pose) in enumerate(choices):
        ax.plot(
            pose[1],
            pose[2],
            marker="*",
            markersize=16,
            color=ATTEMPT_COLORS[i % len(ATTEMPT_COLORS)],
            markeredgecolor="white",
            linestyle="none",
            clip_on=False,
            zorder=5,
            label=label,
        )
    ax.set(xlabel="start position y [m]", ylabel="start orientation φ [rad]")
    ax.set_facecolor("0.9")
    ax.legend(loc="lower right", fontsize=8)
    if ax.figure is not None:
        ax.figure.colorbar(image, ax=ax, label="estimated probability of success")
    return ax


def draw_top_view(
    ax: Axes,
    scenario: Scenario,
    instance: ClutterInstance,
    p_WG: Vector,
    attempts: Sequence[tuple[str, ReachTrace]],
) -> Axes:
    """Draws the environment from above with the arm's first and last posture and the tip's path.

    Args:
        ax: Where to draw.
        scenario: Gives the arm, the start line and the goal's size.
        instance: The clutter as it was drawn.
        p_WG: Goal, shape (3,), metres.
        attempts: Labels and traces of the reaches.
    """
    arm = scenario.arm()
    _draw_objects(ax, instance)
    _draw_starts(ax, scenario)
    for i, (label, trace) in enumerate(attempts):
        color_name = ATTEMPT_COLORS[i % len(ATTEMPT_COLORS)]
        if not trace.q:
            continue
        if isinstance(arm, PlanarArm):
            for q, alpha in ((trace.q[0], 0.25), (trace.q[-1], 0.8)):
                _draw_arm(ax, arm, q, trace.p_WR, color_name, alpha)
        path = np.array(trace.p_WE)
        ax.plot(path[:, 0], path[:, 1], color=color_name, lw=1.5, label=label)
    _draw_goal(ax, scenario, p_WG)
    if ax.get_legend_handles_labels()[0]:  # No attempt of which there is a path, no legend.
        ax.legend(loc="upper left", fontsize=8)
    return ax


def draw_snapshot(
    ax: Axes, scenario: Scenario, instance: ClutterInstance, p_WG: Vector, trace: ReachTrace, k: int
) -> Axes:
    """Draws a sample of a reach from above, with the tip's path up to it (paper Fig. 5).

    Args:
        ax: Where to draw.
        scenario: Gives the arm, the start line and the goal's size.
        instance: The clutter as it was drawn.
        p_WG: Goal, shape (3,), metres.
        trace: Samples with their states.
        k: Index of the sample.
    """
    arm = scenario.arm()
    _draw_objects(ax, instance.with_objects_at(trace.states[k].p_WO))
    _draw_starts(ax, scenario)
    if isinstance(arm, PlanarArm):
        _draw_arm(ax, arm, trace.q[k], trace.p_WR, "0.35", 0.8)
    path = np.array(trace.p_WE[: k + 1])
    ax.plot(path[:, 0], path[:, 1], color="tab:blue", lw=1.0)
    _draw_goal(ax, scenario, p_WG)
    ax.set_title(f"{trace.time_s[k]:.1f} s", fontsize=9)
    return ax


def _draw_objects(ax: Axes, instance: ClutterInstance) -> None:
    for i in range(instance.num_objects):
        color = tuple(MOVABLE_COLOR if instance.movable[i] else FIXED_COLOR)
        position = (instance.p_WO[i, 0], instance.p_WO[i, 1])
        if instance.shape[i] == "box":
            length, width = instance.size[i, :2]
            ax.add_patch(
                Rectangle(
                    (position[0] - 0.5 * length, position[1] - 0.5 * width),
                    length,
                    width,
                    angle=float(np.rad2deg(instance.yaw[i])),
                    rotation_point="center",
                    color=color,
                )
            )
        else:
            ax.add_patch(Circle(position, instance.size[i, 0], color=color))


def _draw_starts(ax: Axes, scenario: Scenario) -> None:
    """Draws where the hand may start, green, or, with a mobile base, where that may, blue."""
    line, track = scenario.task.start_line, scenario.task.base
    if track is None:
        ax.plot([line.x_m] * 2, [line.y_min_m, line.y_max_m], color="tab:green", lw=1, ls="--")
    else:
        ax.plot([0.0, 0.0], [track.y_min_m, track.y_max_m], color="tab:blue", lw=1, ls="--")


def _draw_goal(ax: Axes, scenario: Scenario, p_WG: Vector) -> None:
    ax.add_patch(
        Circle((p_WG[0], p_WG[1]), scenario.stop.success_distance_m, color="tab:cyan", zorder=5)
    )
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", xlim=(-0.3, 1.05), ylim=(-0.75, 0.75))


def _draw_arm(ax: Axes, arm: PlanarArm, q: Vector, p_WR: Vector, color: str, alpha: float) -> None:
    """Draws the links as bars of the skin's width."""
    origins = arm.kinematics.link_origins(q) + p_WR[:2]
    for capsule, begin, end in zip(arm.skin, origins[:-1], origins[1:], strict=True):
        along = (end - begin) / np.linalg.norm(end - begin)
        side = capsule.radius * np.array([-along[1], along[0]])
        corners = [begin - side, begin + side, end + side, end - side]
        ax.add_patch(Polygon(corners, closed=True, color=color, alpha=alpha, lw=0))
        ax.add_patch(Circle((begin[0], begin[1]), capsule.radius, color=color, alpha=alpha, lw=0))


def save_figure(figure: Figure, path: Path, margins: bool = True) -> None:
    """Writes a figure at 150 dots an inch.

    Args:
        figure: The figure.
        path: The file.
        margins: Whether it gets small ones around what is drawn, or is written just as it is.

    Raises:
        LicError: The file cannot be written.
    """
    try:
        figure.savefig(path, dpi=150, bbox_inches="tight" if margins else None)
    except OSError as error:
        raise LicError(f"cannot write {path}: {error.strerror}") from None
