"""What both cameras see while the robot reaches, as an animated picture."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.systems.framework import DiagramBuilder

from lic_drake.errors import readable_errors
from lic_drake.perception.cameras import add_cameras, take_color_image
from lic_drake.perception.config import CamerasConfig
from lic_drake.show.figures import ShownTrial
from lic_drake.show.stage import place

FRAMES_PER_SECOND = 2.0
"""Frames per simulated second."""

SPEED = 2.0
"""Playback speed relative to the reach."""

SHRINK = 2
"""Factor by which frames are smaller than the cameras' images."""


def film_frames(trial: ShownTrial, cameras: CamerasConfig) -> Iterator[NDArray[np.uint8]]:
    """Yields the views of head and external camera side by side, shape (height, width, 3).

    The head camera moves with the robot. A RenderingError says that there are no cameras here.
    """
    builder = DiagramBuilder()
    scene, *sensors = add_cameras(builder, trial.instance, trial.p_WG, cameras, ahead=True)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    step = max(1, round(trial.scenario.mpc.rate_hz / FRAMES_PER_SECOND))
    for trace in trial.traces:
        for state in trace.states[::step]:
            place(scene, context, trace.b0, state.q, state)
            views = [take_color_image(sensor, context) for sensor in sensors]
            yield np.hstack(views)[::SHRINK, ::SHRINK]


def save_film(frames: Iterable[NDArray[np.uint8]], path: Path) -> None:
    """Writes an animated WebP picture of one or more frames, which browsers play in a loop."""
    first, *others = [Image.fromarray(frame) for frame in frames]
    duration = round(1000.0 / (SPEED * FRAMES_PER_SECOND))
    options = {"save_all": True, "append_images": others, "duration": duration, "loop": 0}
    with readable_errors(path, "write"):
        first.save(path, format="WEBP", quality=70, **options)
