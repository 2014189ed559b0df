"""Photographs of a reach: what a camera beside the robot would see, and the contact forces."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    GeometryInstance,
    LightParameter,
    PerceptionProperties,
    RenderCameraCore,
    RenderLabel,
    Rgba,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RenderingError
from lic_drake.perception.cameras import look_at, make_renderer
from lic_drake.perception.image import CameraImage
from lic_drake.reach.pointing_starts import mobile_positions
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import SceneState
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.scene.scene import add_scene
from lic_drake.show.meshes import wear_meshes
from lic_drake.show.pr2_meshes import LinkMesh
from lic_drake.types import Vector

WIDTH, HEIGHT, FOCAL_PX = 1280, 960, 1100.0
"""Size of a photograph and focal length of its camera, pixels."""

GOAL_COLOR = np.array([0.0, 0.65, 0.8, 1.0])
"""Of the goal, RGBA."""
FLOOR_COLOR = np.array([0.74, 0.74, 0.76, 1.0])
"""Of the floor, RGBA."""

_RENDERER = "vtk"
_CLIPPING_M = (0.02, 20.0)
_FLOOR_M = 12.0
# Cylinders of the plane stand with their middle at z = 0.
_FLOOR_BELOW_CLUTTER_M = -0.13


class View(NamedTuple):
    """A place for a camera.

    Attributes:
        p_WC: Where it stands, (x, y, z), metres.
        target: What it looks at, (x, y, z), metres.
    """

    p_WC: tuple[float, float, float]
    target: tuple[float, float, float]


class Photograph(NamedTuple):
    """An image and the contact forces at that moment.

    Attributes:
        image: Colours only; nothing measured its depth.
        p_WC: Where forces act on the arm, shape (n, 3), metres.
        f_W: The forces on it, shape (n, 3), N.
    """

    image: CameraImage
    p_WC: Vector
    f_W: Vector


class Photographer:
    """Photographs states of one environment, as they were simulated elsewhere.

    Args:
        scenario: Robot and contact.
        instance: The environment.
        p_WG: The goal, shape (3,), metres.
        views: Places for a camera by their names.
        meshes: What a PR2 wears instead of the shapes of its model.

    Raises:
        RenderingError: The renderer cannot work on this machine, or not with these meshes.
    """

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        p_WG: Vector,
        views: Mapping[str, View],
        meshes: Sequence[LinkMesh] = (),
    ) -> None:
        renderer = make_renderer(_lamps(any(mesh.path.suffix == ".gltf" for mesh in meshes)))
        builder = DiagramBuilder()
        arm = scenario.arm()
        self._on_wheels = isinstance(arm, Pr2Arm)
        # Contact in a continuous plant depends on nothing but its state.
        self._scene = add_scene(
            builder,
            Pr2Arm(torso_m=scenario.task.torso_m, mobile=True) if self._on_wheels else arm,
            instance,
            replace(scenario.scene, time_step_s=0.0),
            visuals=True,
            base_slides=not self._on_wheels,
        )
        wear_meshes(self._scene, meshes)
        scene_graph = self._scene.scene_graph
        try:
            scene_graph.AddRenderer(_RENDERER, renderer)
        except RuntimeError as error:  # It loads the meshes now.
            raise RenderingError(f"a mesh cannot be rendered: {error}") from None
        ground = 0.0 if self._on_wheels else _FLOOR_BELOW_CLUTTER_M
        floor = Box(_FLOOR_M, _FLOOR_M, 0.02)
        self._add_prop("floor", floor, np.array([0.0, 0.0, ground - 0.01]), FLOOR_COLOR)
        self._add_prop("goal", Sphere(scenario.stop.success_distance_m), p_WG, GOAL_COLOR)
        self._poses = {name: look_at(*view) for name, view in views.items()}
        self._sensors: dict[str, RgbdSensor] = {}
        for name, X_WC in self._poses.items():
            sensor = RgbdSensor(scene_graph.world_frame_id(), X_WC, *_cameras())
            builder.AddNamedSystem(name, sensor)
            self._sensors[name] = sensor
            builder.Connect(scene_graph.get_query_output_port(), sensor.query_object_input_port())
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()

    def take(self, view: str, b0: Vector, state: SceneState) -> Photograph:
        """Returns a photograph.

        Args:
            view: Name of the place for the camera.
            b0: Place of the base and height of the torso, shape (3,), metres.
            state: Where everything is.
        """
        scene, plant = self._scene, self._scene.plant
        context = plant.GetMyMutableContextFromRoot(self._context)
        if self._on_wheels:
            plant.SetPositions(context, scene.arm, mobile_positions(b0, state.q[None])[0])
            plant.SetVelocities(context, scene.arm, np.append(np.zeros(4), state.v))
        else:
            plant.SetPositions(context, scene.base, b0[:2])
            plant.SetPositions(context, scene.arm, state.q)
            plant.SetVelocities(context, scene.arm, state.v)
        plant.SetPositions(context, scene.clutter, state.p_WO.ravel())
        plant.SetVelocities(context, scene.clutter, state.v_WO.ravel())
        sensor, X_WC = self._sensors[view], self._poses[view]
        port = sensor.color_image_output_port()
        rgba = cast(ImageRgba8U, port.Eval(sensor.GetMyContextFromRoot(self._context)))
        image = CameraImage(
            # A copy: what Drake returns may be a view of its own memory.
            color=np.array(np.asarray(rgba.data)[..., :3]),
            depth=np.full((HEIGHT, WIDTH), np.nan),
            focal_px=FOCAL_PX,
            R_WC=np.array(X_WC.rotation().matrix()),
            p_WC=np.array(X_WC.translation()),
        )
        return Photograph(image, *self._forces())

    def _forces(self) -> tuple[Vector, Vector]:
        """Returns where forces act on the skin, and the forces."""
        plant, skin = self._scene.plant, self._scene.skin_links
        port = plant.get_contact_results_output_port()
        results = cast(ContactResults, port.Eval(plant.GetMyContextFromRoot(self._context)))
        points, forces = [], []
        for i in range(results.num_hydroelastic_contacts()):
            patch = results.hydroelastic_contact_info(i)
            surface, force = patch.contact_surface(), patch.F_Ac_W().translational()
            if surface.id_M() in skin or surface.id_N() in skin:
                points.append(surface.centroid())
                forces.append(force if surface.id_M() in skin else -force)
        for i in range(results.num_point_pair_contacts()):
            pair = results.point_pair_contact_info(i)
            ids, force = pair.point_pair(), pair.contact_force()
            if ids.id_A in skin or ids.id_B in skin:
                points.append(pair.contact_point())
                forces.append(force if ids.id_B in skin else -force)
        return np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3))

    def _add_prop(self, name: str, shape: Shape, p_WO: Vector, color: Vector) -> None:
        """Adds a thing that nothing but the cameras notices."""
        scene_graph = self._scene.scene_graph
        source = scene_graph.RegisterSource(name)
        geometry = scene_graph.RegisterAnchoredGeometry(
            source, GeometryInstance(RigidTransform(p_WO), shape, name)
        )
        properties = PerceptionProperties()
        properties.AddProperty("phong", "diffuse", Rgba(*color))
        properties.AddProperty("label", "id", RenderLabel.kDontCare)
        scene_graph.AssignRole(source, geometry, properties)


def _lamps(physical: bool) -> list[LightParameter]:
    """Returns a lamp high up behind the robot, and one that lights what that leaves dark.

    Args:
        physical: Whether a mesh has the materials that make VTK compute all light physically, which
            needs stronger lamps.
    """
    strength = 2.5 if physical else 1.0
    return [
        LightParameter(type="directional", frame=frame, direction=direction, intensity=intensity)
        for frame, direction, intensity in (
            ("world", [0.5, 0.5, -1.0], 0.65 * strength),
            ("camera", [0.0, 0.0, 1.0], 0.75 * strength),
        )
    ]


def _cameras() -> tuple[ColorRenderCamera, DepthRenderCamera]:
    info = CameraInfo(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, 0.5 * WIDTH, 0.5 * HEIGHT)
    core = RenderCameraCore(_RENDERER, info, ClippingRange(*_CLIPPING_M), RigidTransform())
    # The sensor wants one for depth, too, which is never rendered.
    return ColorRenderCamera(core), DepthRenderCamera(core, DepthRange(*_CLIPPING_M))
