"""Draws detections, and a map of passable probabilities, over a camera's image (paper Fig. 2)."""

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse, Polygon
from matplotlib.patheffects import withStroke

from lic_drake.perception.apertures import DetectedApertures
from lic_drake.perception.goal import DetectedGoal
from lic_drake.perception.image import CameraImage
from lic_drake.types import Vector

STATE_COLORS = {"open": "tab:green", "partly": "gold", "blocked": "tab:red", "unseen": "0.6"}
"""Colours of frames around apertures, by what they were found to be."""


def draw_image(ax: Axes, image: CameraImage) -> Axes:
    """Draws a camera's image without axes."""
    ax.imshow(image.color)
    ax.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5))
    ax.set_axis_off()
    return ax


def draw_apertures(ax: Axes, image: CameraImage, found: DetectedApertures) -> Axes:
    """Draws the outlines of apertures in the colour of their state, and how sure that is.

    Args:
        ax: Where to draw.
        image: The image in which they were found.
        found: The apertures.
    """
    draw_image(ax, image)
    for corners, centre, state, probability in zip(
        found.corners, found.p_WA, found.states, found.probability_open, strict=True
    ):
        outline = Polygon(
            image.project(corners), closed=True, fill=False, color=STATE_COLORS[state], lw=1.5
        )
        ax.add_patch(outline)
        _write(ax, image, centre, f"{probability:.2f}", STATE_COLORS[state])
    return ax


def draw_passable_probability(
    ax: Axes,
    image: CameraImage,
    found: DetectedApertures,
    probability: Vector,
    chosen: int | None = None,
) -> Axes:
    """Draws the passable-probability map: the whiter an aperture, the better (paper Fig. 2).

    Args:
        ax: Where to draw.
        image: The image in which the apertures were found.
        found: The apertures.
        probability: Estimated probability of reaching the goal through each of them, shape (n,);
            NaN where the arm cannot reach through, which is drawn as 0 without a number.
        chosen: Index of an aperture that gets a frame.

    Raises:
        ValueError: Numbers of apertures and probabilities differ.
    """
    if probability.shape != (len(found.p_WA),):
        raise ValueError(f"probability has shape {probability.shape}, not ({len(found.p_WA)},)")
    draw_image(ax, image)
    for corners, centre, value in zip(found.corners, found.p_WA, probability, strict=True):
        shade = colormaps["gray"](0.0 if np.isnan(value) else value)
        ax.add_patch(
            Polygon(
                image.project(corners), closed=True, facecolor=shade, edgecolor="0.3", alpha=0.9
            )
        )
        if not np.isnan(value):
            _write(ax, image, centre, f"{value:.2f}", "black" if value > 0.5 else "white")
    if chosen is not None:
        outline = image.project(found.corners[chosen])
        ax.add_patch(Polygon(outline, closed=True, fill=False, edgecolor="tab:cyan", lw=2.5))
    return ax


def draw_goal(ax: Axes, image: CameraImage, found: DetectedGoal, ball_radius_m: float) -> Axes:
    """Draws where the ball was found, and the ellipse of two standard deviations around it.

    Args:
        ax: Where to draw.
        image: The image in which it was found.
        found: The goal.
        ball_radius_m: Radius of the ball, metres.
    """
    draw_image(ax, image)
    centre = image.project(found.p_WG[np.newaxis])[0]
    p_CG = (found.p_WG - image.p_WC) @ image.R_WC
    scale = image.focal_px / p_CG[2]
    in_image = (image.R_WC.T @ found.covariance @ image.R_WC)[:2, :2] * scale**2
    variance, axes = np.linalg.eigh(in_image)
    width, height = 2.0 * 2.0 * np.sqrt(variance)
    angle = float(np.rad2deg(np.arctan2(axes[1, 0], axes[0, 0])))
    ball = 2.0 * scale * ball_radius_m
    xy = (float(centre[0]), float(centre[1]))
    ax.add_patch(Ellipse(xy, ball, ball, fill=False, color="tab:cyan", lw=1.5))
    ax.add_patch(Ellipse(xy, width, height, angle=angle, fill=False, color="black", lw=1.0))
    x, y, z = found.p_WG
    ax.set_title(f"goal at ({x:.3f}, {y:.3f}, {z:.3f}) m", fontsize=9)
    return ax


def _write(ax: Axes, image: CameraImage, p_WQ: Vector, text: str, color: str) -> None:
    column, row = image.project(p_WQ[np.newaxis])[0]
    around = "black" if color == "white" else "white"
    ax.text(
        column,
        row,
        text,
        color=color,
        fontsize=7,
        ha="center",
        va="center",
        weight="bold",
        path_effects=[withStroke(linewidth=2.0, foreground=around)],
    )
