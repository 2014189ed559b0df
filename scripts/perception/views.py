"""Images of an environment without the diagram of detectors."""

from typing import NamedTuple, cast

import numpy as np
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.perception.cameras import add_cameras, camera_image
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import disturbed_image
from lic_drake.types import Vector


class Views(NamedTuple):
    """Images of an environment.

    Attributes:
        head: From the PR2's head.
        external: From the camera that sees the goal.
    """

    head: CameraImage
    external: CameraImage


def take_views(instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig) -> Views:
    """Returns exact images of an environment with a ball at the goal, before the robot reaches.

    Args:
        instance: The environment.
        p_WG: The goal, shape (3,), metres.
        cameras: The cameras.

    Raises:
        RenderingError: The renderer does not work on this machine.
    """
    builder = DiagramBuilder()
    rig = add_cameras(builder, instance, p_WG, cameras)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return Views(
        head=_take(rig.head, root, cameras.head.camera),
        external=_take(rig.external, root, cameras.external.camera),
    )


def disturbed_views(views: Views, cameras: CamerasConfig, rng: np.random.Generator) -> Views:
    """Returns both images with the cameras' errors."""
    return Views(
        head=disturbed_image(views.head, cameras.head.camera, rng),
        external=disturbed_image(views.external, cameras.external.camera, rng),
    )


def _take(sensor: RgbdSensor, root: Context, config: CameraConfig) -> CameraImage:
    context = sensor.GetMyContextFromRoot(root)
    return camera_image(
        cast(ImageRgba8U, sensor.color_image_output_port().Eval(context)),
        cast(ImageDepth32F, sensor.depth_image_32F_output_port().Eval(context)),
        cast(RigidTransform, sensor.body_pose_in_world_output_port().Eval(context)),
        config.focal_px,
    )
