"""A film of all attempts, as an animated picture that browsers play in a loop."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lic_drake.errors import readable_errors
from lic_drake.perception.config import CameraConfig
from lic_drake.show.figures import ShownTrial
from lic_drake.show.stills import StillCamera, draw_still, still_caption

SAMPLES_PER_SECOND = 2.0
"""Frames per simulated second."""

SPEED = 2.0
"""Playback speed relative to the reach."""

HOLD_S = 1.5
"""Time for which the end of an attempt is shown."""

CAMERA = CameraConfig(width=640, height=480, focal_px=550.0)
"""The camera."""

DPI = 150.0
"""Pixels per inch of a frame; each view is 3.2 inches wide."""


class Frame(NamedTuple):
    """A picture, shape (height, width, 3), and for how long it is shown, milliseconds."""

    picture: NDArray[np.uint8]
    duration_ms: int


def film_frames(trial: ShownTrial, drake_models: Path | None = None) -> list[Frame]:
    """Returns the views of all attempts side by side, with captions; see `StillCamera`."""
    camera = StillCamera(trial.scenario, trial.instance, trial.p_WG, drake_models, CAMERA)
    frames = []
    step = max(1, round(trial.scenario.mpc.rate_hz / SAMPLES_PER_SECOND))
    for number, (_, trace) in enumerate(trial, start=1):
        last = len(trace.states) - 1
        for k in [*range(0, last, step), last] if last >= 0 else []:
            stills = [camera.take(view, trace.b0, trace.states[k]) for view in camera.views]
            captions = [still_caption(trial, number, k), *[""] * (len(stills) - 1)]
            drawn = []
            for still, caption in zip(stills, captions, strict=True):
                buffer = BytesIO()
                figure = draw_still(still, caption, scale=0.6)
                figure.savefig(buffer, format="png", dpi=DPI, pil_kwargs={"compress_level": 1})
                drawn.append(np.asarray(Image.open(buffer).convert("RGB")))
            seconds = HOLD_S if k == last else 1.0 / (SPEED * SAMPLES_PER_SECOND)
            frames.append(Frame(np.hstack(drawn), round(1000.0 * seconds)))
    return frames


def save_film(frames: Sequence[Frame], path: Path) -> None:
    """Writes an animated WebP picture of one or more frames."""
    first, *others = [Image.fromarray(frame.picture) for frame in frames]
    options = {"append_images": others, "duration": [frame.duration_ms for frame in frames]}
    with readable_errors(path, "write"):
        first.save(path, format="WEBP", save_all=True, quality=70, loop=0, **options)
