"""What the cameras see of an environment: Drake's RGB-D sensors."""

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FrameId,
    GeometryInstance,
    MakePhongIllustrationProperties,
    PerceptionProperties,
    RenderCameraCore,
    RenderLabel,
    Rgba,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageDepth32F, ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import disturbed_image
from lic_drake.perception.rendering import make_renderer
from lic_drake.perception.systems import camera_image
from lic_drake.robots.pr2_head import HEAD_CAMERA, RIGHT_ARM_AT_REST, LookingPr2
from lic_drake.scene.scene import Scene, SceneConfig, add_scene
from lic_drake.types import Vector

BALL_COLOR = np.array([0.95, 0.80, 0.05, 1.0])
"""Of the goal, RGBA."""
FLOOR_COLOR = np.array([0.62, 0.62, 0.64, 1.0])
"""Of the floor, RGBA."""

_RENDERER = "vtk"
_CLIPPING_M = (0.02, 20.0)


class Views(NamedTuple):
    """Images of an environment.

    Attributes:
        head: From the PR2's head.
        external: From the camera that sees the goal.
    """

    head: CameraImage
    external: CameraImage


def take_views(instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig) -> Views:
    """Looks at an environment with a ball at the goal, before the robot drives up to it.

    Images and poses are exact; `disturbed` adds the errors.

    Args:
        instance: The environment.
        p_WG: The goal, shape (3,), metres.
        cameras: The cameras.

    Raises:
        RenderingError: The renderer cannot work on this machine.
    """
    builder = DiagramBuilder()
    rig = add_rig(builder, instance, p_WG, cameras)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    rig.take_position(root)
    return Views(
        head=_read(rig.head, root, cameras.head.camera),
        external=_read(rig.external, root, cameras.external.camera),
    )


class CameraRig(NamedTuple):
    """An environment with a robot that looks, and its cameras, in a diagram.

    Attributes:
        scene: Robot and environment.
        head: The sensor on the robot's head.
        external: The one that sees the goal.
    """

    scene: Scene
    head: RgbdSensor
    external: RgbdSensor

    def take_position(self, root: Context) -> None:
        """Puts the robot's right arm beside its body, in a context of the diagram."""
        plant = self.scene.plant
        plant.SetPositions(
            plant.GetMyMutableContextFromRoot(root), self.scene.arm, RIGHT_ARM_AT_REST
        )


def add_rig(
    builder: DiagramBuilder,
    instance: ClutterInstance,
    p_WG: Vector,
    cameras: CamerasConfig,
    mobile: bool = False,
) -> CameraRig:
    """Adds an environment, a ball at the goal, the robot where it looks from, and the cameras.

    Args:
        builder: Gets plant, scene graph and the sensors `head` and `external`.
        instance: The environment.
        p_WG: The goal, shape (3,), metres.
        cameras: The cameras.
        mobile: Whether the robot's base and torso are joints.

    Raises:
        RenderingError: The renderer cannot work on this machine.
    """
    head = cameras.head
    robot = LookingPr2(head.base_pose, head.torso_m, head.tilt_deg, mobile)
    scene = add_scene(builder, robot, instance, SceneConfig(), visuals=True)
    plant, scene_graph = scene.plant, scene.scene_graph
    scene_graph.AddRenderer(_RENDERER, make_renderer())
    _add_prop(scene_graph, "ball", Sphere(cameras.ball_radius_m), p_WG, BALL_COLOR)
    _add_prop(scene_graph, "floor", Box(20.0, 20.0, 0.02), np.array([0, 0, -0.01]), FLOOR_COLOR)

    mount = plant.GetFrameByName(HEAD_CAMERA)
    head_sensor = _make_sensor(
        plant.GetBodyFrameIdOrThrow(mount.body().index()),
        mount.GetFixedPoseInBodyFrame(),
        head.camera,
    )
    external_sensor = _make_sensor(
        scene_graph.world_frame_id(),
        look_at(cameras.external.p_WC, cameras.external.target),
        cameras.external.camera,
    )
    for name, sensor in (("head", head_sensor), ("external", external_sensor)):
        builder.AddNamedSystem(name, sensor)
        builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
    return CameraRig(scene=scene, head=head_sensor, external=external_sensor)


def disturbed(views: Views, cameras: CamerasConfig, rng: np.random.Generator) -> Views:
    """Returns the views with noise and gaps, from poses that are not quite what is believed.

    Args:
        views: What `take_views` returned.
        cameras: The cameras with their errors.
        rng: Source of the draws.
    """
    return Views(
        head=disturbed_image(views.head, cameras.head.camera, rng),
        external=disturbed_image(views.external, cameras.external.camera, rng),
    )


def _add_prop(
    scene_graph: SceneGraph, name: str, shape: Shape, p_WO: Vector, color: Vector
) -> None:
    """Adds a thing that only cameras notice."""
    source = scene_graph.RegisterSource(name)
    geometry = scene_graph.RegisterAnchoredGeometry(
        source, GeometryInstance(RigidTransform(p_WO), shape, name)
    )
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(*color))
    properties.AddProperty("label", "id", RenderLabel.kDontCare)
    scene_graph.AssignRole(source, geometry, properties)
    scene_graph.AssignRole(source, geometry, MakePhongIllustrationProperties(color))


def _make_sensor(parent: FrameId, X_PC: RigidTransform, config: CameraConfig) -> RgbdSensor:
    core = RenderCameraCore(
        _RENDERER,
        CameraInfo(
            config.width,
            config.height,
            config.focal_px,
            config.focal_px,
            # The middle of the image. With Drake's own default, half a pixel less, what is straight
            # ahead is drawn half a pixel off it (2 mm at 2 m).
            0.5 * config.width,
            0.5 * config.height,
        ),
        ClippingRange(*_CLIPPING_M),
        RigidTransform(),
    )
    return RgbdSensor(
        parent,
        X_PC,
        ColorRenderCamera(core),
        DepthRenderCamera(core, DepthRange(config.nearest_m, config.furthest_m)),
    )


def look_at(p_WC: Sequence[float], target: Sequence[float]) -> RigidTransform:
    """Returns X_WC of a camera that looks at a point, its x axis level.

    Args:
        p_WC: Where the camera is, (x, y, z), metres.
        target: What it looks at, neither right above nor right below it, (x, y, z), metres.
    """
    z = np.subtract(target, p_WC)
    z /= np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R_WC = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    return RigidTransform(R_WC, np.array(p_WC))


def _read(sensor: RgbdSensor, root: Context, config: CameraConfig) -> CameraImage:
    context = sensor.GetMyContextFromRoot(root)
    return camera_image(
        cast(ImageRgba8U, sensor.color_image_output_port().Eval(context)),
        cast(ImageDepth32F, sensor.depth_image_32F_output_port().Eval(context)),
        cast(RigidTransform, sensor.body_pose_in_world_output_port().Eval(context)),
        config.focal_px,
    )
