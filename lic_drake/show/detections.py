"""Detections, and a map of passable probabilities, over a camera's image (paper Fig. 2)."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon

from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.apertures import DetectedApertures
from lic_drake.perception.goal import DetectedGoal
from lic_drake.perception.image import CameraImage
from lic_drake.perception.observer import Observer
from lic_drake.select.lic import LicSelector
from lic_drake.show.apertures import (
    draw_probabilities,
    estimate_apertures,
    nearest_aperture,
    write,
)
from lic_drake.show.figures import attempts_figure, estimate_title, situation_before

STATE_COLORS = {"open": "tab:green", "partly": "gold", "blocked": "tab:red", "unseen": "0.6"}
"""Colours of frames around apertures, by their detected state."""


def maps_figure(selector: LicSelector, observer: Observer, attempts: Sequence[Attempt]) -> Figure:
    """Returns the passable-probability maps of a selector before all attempts of a trial.

    The attempts may be another strategy's.
    """
    return attempts_figure(
        len(attempts), 6.0, lambda ax, number: _draw_map(ax, selector, observer, attempts, number)
    )


def look_figure(
    selector: LicSelector, observer: Observer, attempts: Sequence[Attempt], number: int
) -> Figure:
    """Returns what was seen before an attempt, from 1, and what was estimated from it."""
    belief = observer.belief(number - 1)
    figure = Figure(figsize=(15.0, 4.3), layout="constrained")
    seen, estimated, external = figure.subplots(1, 3)
    draw_apertures(seen, belief.head, belief.apertures)
    seen.set_title("head camera: probability of being open", fontsize=10)
    _draw_map(estimated, selector, observer, attempts, number)
    draw_goal(external, belief.external, belief.goal, observer.cameras.ball_radius_m)
    external.set_title(f"external camera: {external.get_title()}", fontsize=10)
    return figure


def _draw_map(
    ax: Axes, selector: LicSelector, observer: Observer, attempts: Sequence[Attempt], number: int
) -> None:
    """Draws the passable-probability map over the head camera's image."""
    belief, attempt = observer.belief(number - 1), attempts[number - 1]
    situation = situation_before(attempts, number, belief.starts)
    values = belief.over_all(estimate_apertures(selector.objective(situation), situation))
    image, found = belief.head, belief.apertures
    draw_image(ax, image)
    chosen = int(belief.open_index[nearest_aperture(belief.starts, attempt)])
    draw_probabilities(ax, image.project(found.corners), values, chosen)
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
    outlines, centres = image.project(found.corners), image.project(found.p_WA)
    for outline, centre, state, probability in zip(
        outlines, centres, found.states, found.probability_open, strict=True
    ):
        color = STATE_COLORS[state]
        ax.add_patch(Polygon(outline, closed=True, fill=False, ec=color, lw=1.5))
        write(ax, centre, f"{probability:.2f}", color)
    return ax


def draw_goal(ax: Axes, image: CameraImage, found: DetectedGoal, ball_radius_m: float) -> Axes:
    """Draws the detected ball, and the ellipse of two standard deviations around its centre."""
    draw_image(ax, image)
    centre = image.project(found.p_WG)
    p_CG = (found.p_WG - image.p_WC) @ image.R_WC
    scale = image.focal_px / p_CG[2]
    in_image = (image.R_WC.T @ found.covariance @ image.R_WC)[:2, :2] * scale**2
    variance, vectors = np.linalg.eigh(in_image)
    width, height = 4.0 * np.sqrt(variance)
    angle = float(np.rad2deg(np.arctan2(vectors[1, 0], vectors[0, 0])))
    ball = 2.0 * scale * ball_radius_m
    ax.add_patch(Ellipse(tuple(centre), ball, ball, fill=False, ec="tab:cyan", lw=1.5))
    ax.add_patch(Ellipse(tuple(centre), width, height, angle=angle, fill=False, ec="k", lw=1.0))
    ax.set_title("goal at ({:.3f}, {:.3f}, {:.3f}) m".format(*found.p_WG), fontsize=9)
    return ax
