"""Figures of an environment from above or from a side, with arms and the paths of their tips."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import simulate_request
from lic_drake.reach.start import Starts
from lic_drake.reach.trace import ReachTrace
from lic_drake.robots.arm import Arm
from lic_drake.scene.contact import FIXED_COLOR, MOVABLE_COLOR, STEM_COLOR
from lic_drake.show.figures import ATTEMPT_COLORS
from lic_drake.starts import make_starts
from lic_drake.types import Vector

type PlotAxes = tuple[int, int]
"""Which of x, y and z, as 0, 1 and 2, run along and up the figure."""

TOP: PlotAxes = (0, 1)
"""From above."""
SIDE: PlotAxes = (0, 2)
"""From the robot's right."""
FRONT: PlotAxes = (1, 2)
"""Along x."""

SNAPSHOTS = 4
"""Number of samples of each reach in a figure of snapshots."""

_WORKSPACE = (np.array([-0.3, -0.75]), np.array([1.05, 0.75]))


def draw_view(
    ax: Axes,
    scenario: Scenario,
    instance: ClutterInstance,
    p_WG: Vector,
    attempts: Sequence[tuple[str, ReachTrace]] = (),
    axes: PlotAxes = TOP,
) -> Axes:
    """Draws an environment with the path of each attempt's tip.

    A planar arm is drawn in its first and last posture. Feasible starts are marked, the hand's
    green and, from above, a mobile base's blue.

    Args:
        ax: Where to draw.
        scenario: Gives the arm, the feasible starts and the goal's size.
        instance: The clutter as it was drawn.
        p_WG: Goal, shape (3,), metres.
        attempts: Labels and traces of the reaches.
        axes: From where to look: `TOP`, `SIDE` or `FRONT`.
    """
    _draw_objects(ax, instance, axes, 1.0 if scenario.arm().is_planar else 0.6)
    _draw_starts(ax, make_starts(scenario, instance).grid, axes)
    for i, (label, trace) in enumerate(attempts):
        if not trace.q:
            continue
        color = ATTEMPT_COLORS[i % len(ATTEMPT_COLORS)]
        if scenario.arm().is_planar:  # Before a board, the PR2's thick links would hide everything.
            for q, alpha in ((trace.q[0], 0.25), (trace.q[-1], 0.8)):
                _draw_arm(ax, scenario.arm(), q, trace.b0, axes, color, alpha)
        path = np.array(trace.p_WE)[:, list(axes)]
        ax.plot(*path.T, color=color, lw=2.0, label=label, zorder=3)
    _draw_goal(ax, scenario, p_WG, axes)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper left", fontsize=8)
    return ax


def draw_snapshot(
    ax: Axes, scenario: Scenario, instance: ClutterInstance, p_WG: Vector, trace: ReachTrace, k: int
) -> Axes:
    """Draws sample k of a reach from above, with the tip's path up to it (paper Fig. 5).

    The trace needs its states; for the other arguments see `draw_view`.
    """
    _draw_objects(ax, instance.with_objects_at(trace.states[k].q_clutter), TOP, 1.0)
    _draw_starts(ax, make_starts(scenario, instance).grid, TOP)
    _draw_arm(ax, scenario.arm(), trace.q[k], trace.b0, TOP, "0.35", 0.8)
    path = np.array(trace.p_WE[: k + 1])
    ax.plot(path[:, 0], path[:, 1], color="tab:blue", lw=1.0)
    _draw_goal(ax, scenario, p_WG, TOP)
    ax.set_title(f"{trace.time_s[k]:.1f} s", fontsize=9)
    return ax


def snapshots_figure(attempts: Sequence[Attempt]) -> Figure:
    """Returns a row of snapshots for each attempt, which is simulated again (paper Fig. 5)."""
    figure = Figure(figsize=(3.0 * SNAPSHOTS, 3.3 * len(attempts)), layout="constrained")
    axes = figure.subplots(len(attempts), SNAPSHOTS, squeeze=False)
    for row, attempt in zip(axes, attempts, strict=True):
        request = attempt.request
        instance = request.scenario.sample_instance(request.stream, request.environment)
        trace = simulate_request(request, keep_states=True).trace
        samples = np.linspace(0, len(trace.states) - 1, SNAPSHOTS).round().astype(int)
        for ax, k in zip(row, samples, strict=True):
            draw_snapshot(ax, request.scenario, instance, request.goal, trace, int(k))
        row[-1].set_title(f"{row[-1].get_title()}, {attempt.record.outcome}", fontsize=9)
    return figure


def _draw_objects(ax: Axes, instance: ClutterInstance, axes: PlotAxes, alpha: float) -> None:
    for i in range(instance.num_objects):
        patch = _outline(instance, i, axes)
        patch.set_facecolor(tuple(MOVABLE_COLOR if instance.movable[i] else FIXED_COLOR))
        patch.set(edgecolor="white", linewidth=0.3, alpha=alpha)
        ax.add_patch(patch)
    stems = instance.stems
    if stems is not None:
        tops = stems.p_WH + stems.length[:, np.newaxis] * stems.R_WS[:, :, 2]
        for root, top in zip(stems.p_WH[:, list(axes)], tops[:, list(axes)], strict=True):
            ax.plot(*np.array([root, top]).T, color=STEM_COLOR, lw=2, solid_capstyle="round")


def _outline(instance: ClutterInstance, i: int, axes: PlotAxes) -> Patch:
    """Returns the outline of an object; boxes that are turned are drawn so from above only."""
    p, size = instance.p_WO[i, list(axes)], instance.size[i]
    if instance.shape[i] == "sphere" or (instance.shape[i] == "cylinder" and axes == TOP):
        return Circle((p[0], p[1]), size[0])
    edges = size if instance.shape[i] == "box" else np.array([2 * size[0], 2 * size[0], size[1]])
    width, height = edges[list(axes)]
    yaw = float(np.rad2deg(instance.yaw[i])) if axes == TOP else 0.0
    corner = (p[0] - 0.5 * width, p[1] - 0.5 * height)
    return Rectangle(corner, width, height, angle=yaw, rotation_point="center")


def _draw_starts(ax: Axes, starts: Starts, axes: PlotAxes) -> None:
    """Marks where the hand may start, green, and where a mobile base may be, blue."""
    flat = np.column_stack([starts.x0[:, :2], np.zeros(len(starts))])
    hand = flat if starts.x0.shape[1] == 3 else starts.x0[:, :3]
    for name, points, color in (("hand", hand, "tab:green"), ("base", starts.b0, "tab:blue")):
        places = np.unique(points[:, list(axes)].round(6), axis=0)
        if name == "hand" or (len(places) > 1 and axes == TOP):
            ls = "--" if axes == TOP else "none"
            ax.plot(*places.T, marker=".", ls=ls, color=color, ms=4, lw=0.8, gid=f"{name} starts")


def _draw_arm(
    ax: Axes, arm: Arm, q: Vector, p_WR: Vector, axes: PlotAxes, color: str, alpha: float
) -> None:
    """Draws the skin's capsules as bars of their width."""
    pose = arm.calc_pose(q)
    for capsule in (shape.enclosing_capsule() for shape in arm.skin):
        radius, length = capsule.size
        link = arm.link_names.index(capsule.link)
        middle = p_WR + pose.p_RL[link] + pose.R_RL[link] @ capsule.p_LS
        half = 0.5 * length * pose.R_RL[link] @ capsule.R_LS[:, 2]
        begin, end = (middle - half)[list(axes)], (middle + half)[list(axes)]
        for x, y in (begin, end):
            ax.add_patch(Circle((x, y), radius, color=color, alpha=alpha, lw=0))
        seen = float(np.linalg.norm(end - begin))
        if seen > 1e-9:
            side = radius / seen * np.array([begin[1] - end[1], end[0] - begin[0]])
            corners = [begin - side, begin + side, end + side, end - side]
            ax.add_patch(Polygon(corners, closed=True, color=color, alpha=alpha, lw=0))


def _draw_goal(ax: Axes, scenario: Scenario, p_WG: Vector, axes: PlotAxes) -> None:
    """Draws the goal and sets the limits: the arm's workspace in the plane, else what is drawn."""
    x, y = p_WG[list(axes)]
    radius = scenario.stop.success_distance_m
    ax.add_patch(Circle((x, y), radius, color="tab:cyan", zorder=5, gid="goal"))
    names = [f"{'xyz'[axis]} [m]" for axis in axes]
    ax.set(xlabel=names[0], ylabel=names[1], aspect="equal")
    if scenario.arm().is_planar and axes == TOP:
        low, high = _WORKSPACE
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    else:
        ax.autoscale_view()
