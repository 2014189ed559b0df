"""The observation diagram: environment, cameras, their errors, and detectors."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U, RgbdSensor

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.perception.apertures import DetectedApertures, find_apertures
from lic_drake.perception.cameras import add_cameras, camera_image
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.perception.goal import DetectedGoal, find_goal
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import disturbed_image
from lic_drake.types import Vector
from lic_drake.weak_method import weakly

NUM_CAMERAS = 2
"""The head camera and the external camera."""

type _Calc = Callable[[object, object], None]
"""The type of a calculation in Drake's stubs."""


@dataclass(frozen=True, kw_only=True)
class Look:
    """What the robot saw and detected.

    Attributes:
        head: The image from the PR2's head, with its errors.
        external: The image from the camera that sees the goal, with its errors.
        apertures: What was detected in the head camera's image.
        goal: What was detected in the external camera's image.
    """

    head: CameraImage
    external: CameraImage
    apertures: DetectedApertures
    goal: DetectedGoal


class CameraStation:
    """A PR2 standing back from the clutter to observe it, with both arms at its sides.

    One Drake diagram: plant and scene graph, an `RgbdSensor` on the head and another next to the
    clutter, each followed by a `DisturbedCamera` and a `Detector`. The diagram's input port is
    `look`, its output ports are `head_image`, `external_image`, `apertures` and `goal`. Images are
    rendered once; each look has its own errors.

    Attributes:
        diagram: The diagram.
    """

    def __init__(
        self,
        instance: ClutterInstance,
        p_WG: Vector,
        cameras: CamerasConfig,
        board: ApertureBoard,
        make_rng: Callable[[int], np.random.Generator],
    ) -> None:
        """Builds the diagram.

        Args:
            instance: The environment.
            p_WG: True position of the ball, shape (3,), metres.
            cameras: The cameras.
            board: Gives rows, columns and spacing, which the robot knows beforehand.
            make_rng: Returns the source of errors number `NUM_CAMERAS` * look + camera.

        Raises:
            RenderingError: Cameras cannot be simulated on this machine.
        """
        head, external = cameras.head.camera, cameras.external.camera
        builder = DiagramBuilder()
        rig = add_cameras(builder, instance, p_WG, cameras)
        head_image = DisturbedCamera(head, lambda look: make_rng(NUM_CAMERAS * look))
        external_image = DisturbedCamera(external, lambda look: make_rng(NUM_CAMERAS * look + 1))
        apertures = Detector(partial(find_apertures, camera=head, board=board))
        goal = Detector(partial(find_goal, camera=external, ball_radius_m=cameras.ball_radius_m))
        _connect(builder, "head", rig.head, head_image, "apertures", apertures)
        _connect(builder, "external", rig.external, external_image, "goal", goal)
        builder.ExportInput(head_image.GetInputPort("look"), "look")
        builder.ConnectInput("look", external_image.GetInputPort("look"))
        self.diagram = builder.Build()
        self.diagram.set_name("camera_station")
        self._context = self.diagram.CreateDefaultContext()

    def look(self, number: int) -> Look:
        """Returns what is seen and detected.

        Args:
            number: Number of the look, from 0.

        Raises:
            PerceptionError: The board or the ball is not in view.
        """
        self.diagram.GetInputPort("look").FixValue(self._context, float(number))
        return Look(
            head=cast(CameraImage, self._output("head_image")),
            external=cast(CameraImage, self._output("external_image")),
            apertures=cast(DetectedApertures, self._output("apertures")),
            goal=cast(DetectedGoal, self._output("goal")),
        )

    def _output(self, name: str) -> object:
        return self.diagram.GetOutputPort(name).Eval(self._context)


class DisturbedCamera(LeafSystem):
    """Adds a real camera's errors to what an `RgbdSensor` renders.

    Input ports: `color_image` (ImageRgba8U), `depth_image` (ImageDepth32F, metres),
    `body_pose_in_world` (RigidTransform, the camera's true pose X_WC), and `look`, the number of
    the look (1), which determines the errors. Output port: `image` (CameraImage).

    Args:
        config: The camera and its errors.
        make_rng: Returns the source of a look's errors.
    """

    def __init__(
        self, config: CameraConfig, make_rng: Callable[[int], np.random.Generator]
    ) -> None:
        super().__init__()
        self._config, self._make_rng = config, make_rng
        for name, value in (
            ("color_image", ImageRgba8U()),
            ("depth_image", ImageDepth32F()),
            ("body_pose_in_world", RigidTransform()),
        ):
            self.DeclareAbstractInputPort(name, Value(value))
        self.DeclareVectorInputPort("look", 1)
        calc = weakly(cast(_Calc, self._calc_image))
        self.DeclareAbstractOutputPort("image", _make_placeholder, calc)

    def _calc_image(self, context: Context, output: AbstractValue) -> None:
        look = int(np.asarray(self.GetInputPort("look").Eval(context))[0])
        rgba = cast(ImageRgba8U, self.GetInputPort("color_image").Eval(context))
        depth = cast(ImageDepth32F, self.GetInputPort("depth_image").Eval(context))
        X_WC = cast(RigidTransform, self.GetInputPort("body_pose_in_world").Eval(context))
        exact = camera_image(rgba, depth, X_WC, self._config.focal_px)
        output.set_value(disturbed_image(exact, self._config, self._make_rng(look)))


class Detector(LeafSystem):
    """Detects something in an image. Input port: `image` (CameraImage); output port: `found`.

    Args:
        find: Detects it; evaluating the output raises what it raises.
    """

    def __init__(self, find: Callable[[CameraImage], object]) -> None:
        super().__init__()
        self._find = find
        self.DeclareAbstractInputPort("image", _make_placeholder())
        calc = weakly(cast(_Calc, self._calc_found))
        self.DeclareAbstractOutputPort("found", _make_placeholder, calc)

    def _calc_found(self, context: Context, output: AbstractValue) -> None:
        image = cast(CameraImage, self.GetInputPort("image").Eval(context))
        output.set_value(self._find(image))


def _connect(
    builder: DiagramBuilder,
    camera_name: str,
    sensor: RgbdSensor,
    camera: DisturbedCamera,
    target_name: str,
    detector: Detector,
) -> None:
    """Connects sensor, errors and detector; exports the image and what is detected."""
    builder.AddNamedSystem(f"{camera_name}_errors", camera)
    builder.AddNamedSystem(f"{target_name}_detector", detector)
    for port, source in (
        ("color_image", sensor.color_image_output_port()),
        ("depth_image", sensor.depth_image_32F_output_port()),
        ("body_pose_in_world", sensor.body_pose_in_world_output_port()),
    ):
        builder.Connect(source, camera.GetInputPort(port))
    builder.Connect(camera.GetOutputPort("image"), detector.GetInputPort("image"))
    builder.ExportOutput(camera.GetOutputPort("image"), f"{camera_name}_image")
    builder.ExportOutput(detector.GetOutputPort("found"), target_name)


def _make_placeholder() -> AbstractValue:
    """Returns the initial value of a port that carries a Python object."""
    placeholder: AbstractValue = AbstractValue.Make(object())
    return placeholder
