"""What the cameras see while the robot reaches: a film of both views."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.sensors import ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import LicError
from lic_drake.perception.cameras import add_cameras
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.reach.pointing_starts import mobile_positions
from lic_drake.reach.trace import SceneState
from lic_drake.types import Vector

SHRINK = 2
"""A film has so many times fewer columns and rows than the cameras."""


class FilmCamera:
    """Films states of an environment, as they were simulated elsewhere, with both cameras.

    Args:
        instance: The environment.
        p_WG: Where the ball is, shape (3,), metres.
        cameras: The cameras; the head's moves with the robot.

    Raises:
        RenderingError: Cameras cannot be simulated on this machine.
    """

    def __init__(self, instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig) -> None:
        builder = DiagramBuilder()
        small = replace(
            cameras,
            head=replace(cameras.head, camera=_shrunk(cameras.head.camera)),
            external=replace(cameras.external, camera=_shrunk(cameras.external.camera)),
        )
        self._rig = add_cameras(builder, instance, p_WG, small, mobile=True)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def frame(self, b0: Vector, state: SceneState) -> NDArray[np.uint8]:
        """Returns the head's view and the external one side by side, shape (height, width, 3).

        Args:
            b0: Place of the base and height of the torso, shape (3,), metres.
            state: Where arm and clutter are.
        """
        scene = self._rig.scene
        plant = scene.plant
        context = plant.GetMyMutableContextFromRoot(self._context)
        plant.SetPositions(context, scene.arm, mobile_positions(b0, state.q[None])[0])
        plant.SetPositions(context, scene.clutter, state.p_WO.ravel())
        views = [_colors(sensor, self._context) for sensor in (self._rig.head, self._rig.external)]
        return np.hstack(views)


def save_film(frames: Iterable[NDArray[np.uint8]], frames_per_second: float, path: Path) -> None:
    """Writes an animated WebP picture, which browsers play over and over.

    Args:
        frames: At least one, each of shape (height, width, 3).
        frames_per_second: How fast it plays.
        path: Where it goes.

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


def _colors(sensor: RgbdSensor, root: Context) -> NDArray[np.uint8]:
    port = sensor.color_image_output_port()
    rgba = cast(ImageRgba8U, port.Eval(sensor.GetMyContextFromRoot(root)))
    # A copy: what Drake returns may be a view of its own memory.
    return np.array(np.asarray(rgba.data)[..., :3])
