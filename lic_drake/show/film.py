"""What both cameras see while the robot reaches, as an animated picture."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.systems.framework import DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import LicError
from lic_drake.perception.cameras import add_cameras, take_color_image
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.reach.trace import SceneState
from lic_drake.show.stage import place
from lic_drake.types import Vector

SHRINK = 2
"""Factor by which a film's images are smaller than the cameras'."""


class FilmCamera:
    """Films states of an environment with both cameras; the head camera moves with the robot."""

    def __init__(self, instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig) -> None:
        """Builds the scene.

        Args:
            instance: The environment.
            p_WG: Position of the ball, shape (3,), metres.
            cameras: The cameras.

        Raises:
            RenderingError: Cameras cannot be simulated on this machine.
        """
        builder = DiagramBuilder()
        head = replace(cameras.head, camera=_shrunk(cameras.head.camera))
        external = replace(cameras.external, camera=_shrunk(cameras.external.camera))
        small = replace(cameras, head=head, external=external)
        self._rig = add_cameras(builder, instance, p_WG, small, ahead=True)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def frame(self, b0: Vector, state: SceneState) -> NDArray[np.uint8]:
        """Returns the head's view and the external one side by side, shape (height, width, 3).

        Args:
            b0: Base position and torso height, shape (3,), metres.
            state: Where arm and clutter are.
        """
        place(self._rig.scene, self._context, b0, state.q, state)
        sensors = (self._rig.head, self._rig.external)
        return np.hstack([take_color_image(sensor, self._context) for sensor in sensors])


def save_film(frames: Iterable[NDArray[np.uint8]], frames_per_second: float, path: Path) -> None:
    """Writes an animated WebP picture, which browsers play in a loop.

    Args:
        frames: At least one, each of shape (height, width, 3).
        frames_per_second: Playback speed.
        path: The file.

    Raises:
        LicError: It cannot be written.
    """
    first, *others = [Image.fromarray(frame) for frame in frames]
    try:
        first.save(
            path,
            format="WEBP",
            save_all=True,
            append_images=others,
            duration=round(1000.0 / frames_per_second),
            loop=0,
            quality=70,
        )
    except OSError as error:
        raise LicError(f"cannot write {path}: {error.strerror or error}") from None


def _shrunk(camera: CameraConfig) -> CameraConfig:
    return replace(
        camera,
        width=max(16, camera.width // SHRINK),
        height=max(16, camera.height // SHRINK),
        focal_px=camera.focal_px / SHRINK,
    )
