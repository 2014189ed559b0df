"""Detections, and a map of passable probabilities, over a camera's image (paper Fig. 2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon
from matplotlib.patheffects import withStroke

from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.apertures import DetectedApertures
from lic_drake.perception.goal import DetectedGoal
from lic_drake.perception.image import CameraImage
from lic_drake.perception.observer import Observer
from lic_drake.select.lic import LicSelector
from lic_drake.show.apertures import estimate_apertures
from lic_drake.show.figures import estimate_title, situations
from lic_drake.types import Vector

STATE_COLORS = {"open": "tab:green", "partly": "gold", "blocked": "tab:red", "unseen": "0.6"}
"""Colours of frames around apertures, by their detected state."""


def maps_figure(selector: LicSelector, observer: Observer, attempts: Sequence[Attempt]) -> Figure:
    """Returns the passable-probability maps before all attempts.

    Args:
        selector: Whose estimates to draw; the attempts may be another strategy's.
        observer: What the robot saw before each attempt.
        attempts: The attempts, all but the last one failures.
    """
    figure = Figure(figsize=(6.0 * len(attempts), 4.8), layout="constrained")
    axes = figure.subplots(1, len(attempts), squeeze=False)[0]
    for number, ax in enumerate(axes, start=1):
        _draw_map(ax, selector, observer, attempts, number)
    return figure


def look_figure(
    selector: LicSelector, observer: Observer, attempts: Sequence[Attempt], number: int
) -> Figure:
    """Returns what was seen before an attempt, from 1, and what was estimated from it."""
    look = observer.belief(number - 1).look
    figure = Figure(figsize=(15.0, 4.3), layout="constrained")
    seen, estimated, external = figure.subplots(1, 3)
    draw_apertures(seen, look.views.head, look.apertures)
    seen.set_title("head camera: probability of being open", fontsize=10)
    _draw_map(estimated, selector, observer, attempts, number)
    draw_goal(external, look.views.external, look.goal, observer.cameras.ball_radius_m)
    external.set_title(f"external camera: {external.get_title()}", fontsize=10)
    return figure


def _draw_map(
    ax: Axes, selector: LicSelector, observer: Observer, attempts: Sequence[Attempt], number: int
) -> None:
    beliefs = [observer.belief(k) for k in range(number)]
    *_, (_, attempt, situation) = situations(
        attempts[:number], [belief.starts for belief in beliefs]
    )
    belief, look = beliefs[-1], beliefs[-1].look
    values = belief.over_all(estimate_apertures(selector.objective(situation), belief.starts))
    apart = np.linalg.norm(belief.starts.p_WA - attempt.request.start.x0[:3], axis=1)
    chosen = int(belief.index[np.argmin(apart)])
    draw_passable_probability(ax, look.views.head, look.apertures, values, chosen)
    ax.set_title(estimate_title(selector, number, attempt), fontsize=10)


def draw_image(ax: Axes, image: CameraImage) -> Axes:
    """Draws a camera's image without axes."""
    height, width = image.shape
    ax.imshow(image.color)
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
    ax.set_axis_off()
    return ax


def draw_apertures(ax: Axes, image: CameraImage, found: DetectedApertures) -> Axes:
    """Draws apertures in the colours of their states, with their probabilities of being open."""
    draw_image(ax, image)
    for corners, centre, state, probability in zip(
        found.corners, found.p_WA, found.states, found.probability_open, strict=True
    ):
        color = STATE_COLORS[state]
        ax.add_patch(Polygon(image.project(corners), closed=True, fill=False, ec=color, lw=1.5))
        _write(ax, image, centre, f"{probability:.2f}", color)
    return ax


def draw_passable_probability(
    ax: Axes,
    image: CameraImage,
    found: DetectedApertures,
    probability: Vector,
    chosen: int | None = None,
) -> Axes:
    """Draws the passable-probability map: the brighter an aperture, the better (paper Fig. 2).

    Args:
        ax: Where to draw.
        image: The image in which the apertures were detected.
        found: The apertures.
        probability: Estimated probability of reaching the goal through each of them, shape (n,);
            NaN, drawn as 0 without a number, where the arm cannot reach through.
        chosen: Index of an aperture that gets a frame.

    Raises:
        ValueError: Numbers of apertures and probabilities differ.
    """
    if probability.shape != (len(found.p_WA),):
        raise ValueError(f"probability has shape {probability.shape}, not ({len(found.p_WA)},)")
    draw_image(ax, image)
    outlines = [image.project(corners) for corners in found.corners]
    for outline, centre, value in zip(outlines, found.p_WA, probability, strict=True):
        shade = colormaps["gray"](np.nan_to_num(value))
        ax.add_patch(Polygon(outline, closed=True, facecolor=shade, edgecolor="0.3", alpha=0.9))
        if not np.isnan(value):
            _write(ax, image, centre, f"{value:.2f}", "black" if value > 0.5 else "white")
    if chosen is not None:
        ax.add_patch(Polygon(outlines[chosen], closed=True, fill=False, ec="tab:cyan", lw=2.5))
    return ax


def draw_goal(ax: Axes, image: CameraImage, found: DetectedGoal, ball_radius_m: float) -> Axes:
    """Draws the detected ball, and the ellipse of two standard deviations around its centre."""
    draw_image(ax, image)
    column, row = image.project(found.p_WG[np.newaxis])[0].tolist()
    p_CG = (found.p_WG - image.p_WC) @ image.R_WC
    scale = image.focal_px / p_CG[2]
    in_image = (image.R_WC.T @ found.covariance @ image.R_WC)[:2, :2] * scale**2
    variance, vectors = np.linalg.eigh(in_image)
    width, height = 4.0 * np.sqrt(variance)
    angle = float(np.rad2deg(np.arctan2(vectors[1, 0], vectors[0, 0])))
    ball = 2.0 * scale * ball_radius_m
    ax.add_patch(Ellipse((column, row), ball, ball, fill=False, ec="tab:cyan", lw=1.5))
    ax.add_patch(Ellipse((column, row), width, height, angle=angle, fill=False, ec="k", lw=1.0))
    ax.set_title("goal at ({:.3f}, {:.3f}, {:.3f}) m".format(*found.p_WG), fontsize=9)
    return ax


def _write(ax: Axes, image: CameraImage, p_WQ: Vector, text: str, color: str) -> None:
    column, row = image.project(p_WQ[np.newaxis])[0]
    around = withStroke(linewidth=2.0, foreground="black" if color == "white" else "white")
    middle = {"ha": "center", "va": "center"}
    ax.text(
        column, row, text, middle, color=color, fontsize=7, weight="bold", path_effects=[around]
    )
