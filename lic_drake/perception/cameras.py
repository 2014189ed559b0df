"""The simulated cameras: Drake's RGB-D sensors on a PR2's head and next to the clutter.

Images are rendered by VTK on EGL, which needs neither display nor GPU.
"""

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    FrameId,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngine,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageDepth32F, ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RenderingError
from lic_drake.perception.config import CameraConfig, CamerasConfig
from lic_drake.perception.image import CameraImage
from lic_drake.robots.pr2 import HEAD_CAMERA, RIGHT_ARM_AT_REST, make_pr2
from lic_drake.scene.scene import SceneConfig, add_scene
from lic_drake.types import Vector

RENDERER = "vtk"
"""Name of the renderer in a scene graph."""

BALL_COLOR, FLOOR_COLOR = np.array([[0.95, 0.80, 0.05, 1.0], [0.62, 0.62, 0.64, 1.0]])
"""RGBA."""

# A ceiling lamp, and some light from the camera.
_ROOM = (
    LightParameter(type="directional", frame="world", direction=[0.3, -0.2, -1.0], intensity=0.8),
    LightParameter(type="directional", frame="camera", direction=[0, 0, 1], intensity=0.6),
)


def make_renderer(lights: Sequence[LightParameter] = _ROOM) -> RenderEngine:
    """Returns a renderer of camera images; a RenderingError if a system library is missing."""
    params = RenderEngineVtkParams(
        backend="EGL", default_clear_color=[0.80, 0.84, 0.88], lights=list(lights)
    )
    try:
        return MakeRenderEngineVtk(params)
    except RuntimeError as error:
        raise RenderingError(
            f"cameras cannot be simulated: {' '.join(str(error).split())} A graphics library is"
            " missing or does not work; install it with: apt-get install libegl1 libgl1"
            " libgl1-mesa-dri"
        ) from None


class Views(NamedTuple):
    """Images of the PR2's head camera, and of the external one that sees the goal."""

    head: CameraImage
    external: CameraImage


def take_views(instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig) -> Views:
    """Returns exact images of an environment, before the robot reaches.

    A RenderingError says that there are no cameras here.
    """
    builder = DiagramBuilder()
    head, external = _add_cameras(builder, instance, p_WG, cameras)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    return Views(
        _take(head, cameras.head.camera, root), _take(external, cameras.external.camera, root)
    )


def _add_cameras(
    builder: DiagramBuilder, instance: ClutterInstance, p_WG: Vector, cameras: CamerasConfig
) -> tuple[RgbdSensor, RgbdSensor]:
    """Adds an environment, a ball at the goal, a PR2 that observes it, and the cameras.

    In the default context the robot stands where it looks from, its right arm at its side. Returned
    are the sensor on the head and the external one. Raises a RenderingError as `make_renderer`.
    """
    head, external = cameras.head, cameras.external
    x, y, heading = head.base_pose
    robot = make_pr2(heading, head.tilt_deg)
    robot.check_height(head.torso_m)
    scene = add_scene(builder, robot, instance, SceneConfig(), visuals=True, mobile=True)
    plant, scene_graph = scene.plant, scene.scene_graph
    scene_graph.AddRenderer(RENDERER, make_renderer())
    add_prop(scene_graph, "ball", Sphere(cameras.ball_radius_m), p_WG, BALL_COLOR)
    add_prop(scene_graph, "floor", Box(20.0, 20.0, 0.02), np.array([0, 0, -0.01]), FLOOR_COLOR)
    mount = plant.GetFrameByName(HEAD_CAMERA)
    parent = plant.GetBodyFrameIdOrThrow(mount.body().index())
    b0 = np.array([x, y, head.torso_m])
    plant.SetDefaultPositions(scene.arm, robot.positions(b0, RIGHT_ARM_AT_REST))
    X_WC = look_at(external.p_WC, external.target)
    X_PC = mount.GetFixedPoseInBodyFrame()
    return (
        add_camera(builder, scene_graph, "head", head.camera, X_PC, parent),
        add_camera(builder, scene_graph, "external", external.camera, X_WC),
    )


def take_color_image(sensor: RgbdSensor, root: Context) -> NDArray[np.uint8]:
    """Returns the colours that a sensor sees, shape (height, width, 3), without rendering depth."""
    rgba = sensor.color_image_output_port().Eval(sensor.GetMyContextFromRoot(root))
    # A copy: what Drake returns may be a view of its own memory.
    return np.array(np.asarray(cast(ImageRgba8U, rgba).data)[..., :3])


def _take(sensor: RgbdSensor, config: CameraConfig, root: Context) -> CameraImage:
    context = sensor.GetMyContextFromRoot(root)
    measured = cast(ImageDepth32F, sensor.depth_image_32F_output_port().Eval(context))
    X_WC = cast(RigidTransform, sensor.body_pose_in_world_output_port().Eval(context))
    depth = np.array(np.asarray(measured.data)[..., 0], dtype=np.float64)
    depth[~np.isfinite(depth) | (depth <= 0.0)] = np.nan
    return CameraImage(
        color=take_color_image(sensor, root),
        depth=depth,
        focal_px=config.focal_px,
        R_WC=np.array(X_WC.rotation().matrix()),
        p_WC=np.array(X_WC.translation()),
    )


def add_camera(
    builder: DiagramBuilder,
    scene_graph: SceneGraph,
    name: str,
    config: CameraConfig,
    X_PC: RigidTransform,
    parent: FrameId | None = None,
) -> RgbdSensor:
    """Adds a sensor to a scene graph with a renderer named `RENDERER`.

    X_PC is the camera's pose, its z axis forward, in its parent frame, by default the world.
    """
    # The optical axis in the middle of the image. Drake's own default is half a pixel less, which
    # draws what is straight ahead half a pixel off it (2 mm at 2 m).
    centre = 0.5 * config.width, 0.5 * config.height
    info = CameraInfo(config.width, config.height, config.focal_px, config.focal_px, *centre)
    core = RenderCameraCore(RENDERER, info, ClippingRange(0.02, 20.0), RigidTransform())
    sensor = RgbdSensor(
        scene_graph.world_frame_id() if parent is None else parent,
        X_PC,
        ColorRenderCamera(core),
        DepthRenderCamera(core, DepthRange(config.nearest_m, config.furthest_m)),
    )
    builder.AddNamedSystem(name, sensor)
    builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
    return sensor


def add_prop(scene_graph: SceneGraph, name: str, shape: Shape, p_WO: Vector, color: Vector) -> None:
    """Adds a fixed object that only cameras see; `color` is RGBA, shape (4,)."""
    source = scene_graph.RegisterSource(name)
    geometry = scene_graph.RegisterAnchoredGeometry(
        source, GeometryInstance(RigidTransform(p_WO), shape, name)
    )
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(*color))
    scene_graph.AssignRole(source, geometry, properties)


def look_at(p_WC: Sequence[float], target: Sequence[float]) -> RigidTransform:
    """Returns X_WC, its x axis level, of a camera at p_WC that looks at a point, metres."""
    z = np.subtract(target, p_WC)
    z /= np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    R_WC = RotationMatrix(np.column_stack([x, np.cross(z, x), z]))
    return RigidTransform(R_WC, np.array(p_WC))
