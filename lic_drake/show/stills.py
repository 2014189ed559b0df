"""Stills of a demonstration: where each attempt began, where it pushed hardest, where it ended."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RenderingError
from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.show.photographs import HEIGHT, WIDTH, Photograph, Photographer, View
from lic_drake.show.plots import save_figure
from lic_drake.show.pr2_meshes import LinkMesh
from lic_drake.types import Vector

PLANAR_VIEWS = {"": View((-0.45, -0.62, 0.95), (0.46, 0.0, -0.08))}
"""From behind and above, to the right."""

PR2_VIEWS = {
    "": View((-0.75, -2.25, 1.75), (0.22, -0.05, 0.78)),
    "inside": View((1.8, -1.0, 1.75), (0.55, -0.12, 1.0)),
}
"""Robot, board and clutter from the right; the clutter from behind the board."""

NEWTONS_PER_METRE = 20.0
"""Scale of the arrows that stand for forces."""

LONGEST_ARROW_M = 0.3
"""Arrows of larger forces are no longer; the words say how large they are."""

LEAST_FORCE_N = 0.05
"""Smaller forces are not drawn."""


def save_stills(
    scenario: Scenario,
    instance: ClutterInstance,
    p_WG: Vector,
    done: Sequence[Attempt],
    traces: Sequence[ReachTrace],
    out: Path,
    say: Callable[[str], None],
    meshes: Sequence[LinkMesh] = (),
) -> dict[str, Path]:
    """Writes attempt1_start.png, attempt1_middle.png and attempt1_end.png, and so on.

    For a robot in space attempt1_inside.png shows the end from behind the board. Stills of an
    earlier demonstration in the folder are removed. Without a renderer there are none.

    Args:
        scenario: Robot and contact.
        instance: The environment.
        p_WG: The goal, shape (3,), metres.
        done: The attempts in their order.
        traces: Their samples with their states.
        out: The folder.
        say: Gets a line if stills cannot be rendered.
        meshes: What a PR2 wears instead of the shapes of its model.

    Returns:
        The files by their kind.

    Raises:
        LicError: A file cannot be written.
    """
    for name in ("start", "middle", "end", "inside"):
        for old in out.glob(f"attempt[1-9]_{name}.png"):
            old.unlink()
    views = PLANAR_VIEWS if scenario.arm().surface is None else PR2_VIEWS
    try:
        photographer = Photographer(scenario, instance, p_WG, views, meshes)
    except RenderingError as error:
        say(f"no stills: {error}")
        return {}
    files = {}
    for number, (attempt, trace) in enumerate(zip(done, traces, strict=True), start=1):
        if not trace.states:
            continue
        b0 = attempt.request.start.b0
        last = len(trace.states) - 1
        hardest = int(np.argmax(trace.total_force)) if any(trace.contacts) else last // 2
        moments = {"start": 0, "middle": hardest, "end": last}
        shots = [(name, "", k) for name, k in moments.items()]
        shots += [(view, view, last) for view in views if view]
        for name, view, k in shots:
            photograph = photographer.take(view, b0, trace.states[k])
            words = f"attempt {number}, {trace.time_s[k]:.1f} s"
            if k == last:
                words += f": {attempt.record.outcome}"
            path = out / f"attempt{number}_{name}.png"
            save_figure(draw_photograph(photograph, words), path, margins=False)
            files[f"attempt {number} {name}"] = path
    return files


def draw_photograph(photograph: Photograph, words: str) -> Figure:
    """Returns a photograph with the forces on the arm and a line of words.

    Args:
        photograph: What to draw.
        words: What is said of it.
    """
    image = photograph.image
    figure = Figure(figsize=(0.005 * WIDTH, 0.005 * HEIGHT))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.imshow(image.color)
    ax.set(xlim=(-0.5, WIDTH - 0.5), ylim=(HEIGHT - 0.5, -0.5))
    ax.set_axis_off()
    strength = np.linalg.norm(photograph.f_W, axis=1)
    shown = strength > LEAST_FORCE_N
    length = np.minimum(strength[shown] / NEWTONS_PER_METRE, LONGEST_ARROW_M)
    arrows = photograph.f_W[shown] * (length / strength[shown])[:, np.newaxis]
    tails = image.project(photograph.p_WC[shown])
    heads = image.project(photograph.p_WC[shown] + arrows)
    for tail, head in zip(tails, heads, strict=True):
        ax.annotate(
            "",
            xy=(head[0], head[1]),
            xytext=(tail[0], tail[1]),
            annotation_clip=False,
            arrowprops={"arrowstyle": "-|>", "color": "crimson", "lw": 1.8, "shrinkA": 0},
        )
    if np.any(shown):
        words += f"; forces on the arm up to {strength.max():.1f} N"
    paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.7}
    ax.text(30, 45, words, fontsize=9, color="0.15", bbox=paper)
    return figure
