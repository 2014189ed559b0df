"""The diagram in which the robot looks: environment, cameras, their errors, and detectors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.perception.apertures import BoardModel, DetectedApertures
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.perception.goal import DetectedGoal
from lic_drake.perception.image import CameraImage
from lic_drake.perception.systems import (
    Detector,
    DisturbedCamera,
    make_aperture_detector,
    make_goal_detector,
)
from lic_drake.perception.views import Views, add_rig
from lic_drake.types import Vector

NUM_CAMERAS = 2
"""The head's and the external one."""


@dataclass(frozen=True, kw_only=True)
class Look:
    """What the robot saw, and what it took it for.

    Attributes:
        views: The images, with their errors.
        apertures: What the head's camera found.
        goal: What the external camera found.
    """

    views: Views
    apertures: DetectedApertures
    goal: DetectedGoal


class Lookout:
    """A PR2 some way before an environment, both arms beside its body.

    One Drake diagram: plant and scene graph, an `RgbdSensor` on the head and another beside the
    clutter, each followed by its errors and by its detector. The diagram's input port is `look`,
    its output ports are `head_image`, `external_image`, `apertures` and `goal`. Images are
    rendered once; a further look has other errors.

    Args:
        instance: The environment.
        p_WG: Where the ball is, shape (3,), metres.
        cameras: The cameras.
        board: What the robot knows of the board beforehand.
        draw: Returns the source of a look's errors.

    Attributes:
        diagram: The diagram.

    Raises:
        RenderingError: Cameras cannot be simulated on this machine.
    """

    def __init__(
        self,
        instance: ClutterInstance,
        p_WG: Vector,
        cameras: CamerasConfig,
        board: BoardModel,
        draw: Callable[[int], np.random.Generator],
    ) -> None:
        builder = DiagramBuilder()
        rig = add_rig(builder, instance, p_WG, cameras)
        head, external = cameras.head.camera, cameras.external.camera
        ball_m = cameras.ball_radius_m
        _add_camera(builder, "head", rig.head, _Draws(draw, 0), head)
        _add_camera(builder, "external", rig.external, _Draws(draw, 1), external)
        _add_detector(builder, "head", "apertures", make_aperture_detector(head, board))
        _add_detector(builder, "external", "goal", make_goal_detector(external, ball_m))
        self.diagram = builder.Build()
        self.diagram.set_name("lookout")
        self._context = self.diagram.CreateDefaultContext()
        rig.take_position(self._context)

    def look(self, number: int) -> Look:
        """Looks.

        Args:
            number: Which look it is, from 0.

        Raises:
            PerceptionError: The board or the ball is not in view.
        """
        self.diagram.GetInputPort("look").FixValue(self._context, float(number))
        return Look(
            views=Views(
                head=cast(CameraImage, self._output("head_image")),
                external=cast(CameraImage, self._output("external_image")),
            ),
            apertures=cast(DetectedApertures, self._output("apertures")),
            goal=cast(DetectedGoal, self._output("goal")),
        )

    def _output(self, name: str) -> object:
        return self.diagram.GetOutputPort(name).Eval(self._context)


@dataclass(frozen=True)
class _Draws:
    """Draws of its own for each camera."""

    draw: Callable[[int], np.random.Generator]
    camera: int

    def __call__(self, look: int) -> np.random.Generator:
        return self.draw(NUM_CAMERAS * look + self.camera)


def _add_camera(
    builder: DiagramBuilder, name: str, sensor: RgbdSensor, draw: _Draws, config: CameraConfig
) -> None:
    """Adds the errors of a camera; exports its image, and the number of the look as an input."""
    camera = builder.AddNamedSystem(f"{name}_errors", DisturbedCamera(config, draw))
    for port, source in (
        ("color_image", sensor.color_image_output_port()),
        ("depth_image", sensor.depth_image_32F_output_port()),
        ("body_pose_in_world", sensor.body_pose_in_world_output_port()),
    ):
        builder.Connect(source, camera.GetInputPort(port))
    look = camera.GetInputPort("look")
    if draw.camera == 0:
        builder.ExportInput(look, "look")
    else:
        builder.ConnectInput("look", look)
    builder.ExportOutput(camera.GetOutputPort("image"), f"{name}_image")


def _add_detector(builder: DiagramBuilder, camera: str, name: str, detector: Detector) -> None:
    """Adds what looks for something in a camera's image; exports what it finds."""
    builder.AddNamedSystem(f"{name}_detector", detector)
    images = builder.GetSubsystemByName(f"{camera}_errors").GetOutputPort("image")
    builder.Connect(images, detector.GetInputPort("image"))
    builder.ExportOutput(detector.GetOutputPort("found"), name)
