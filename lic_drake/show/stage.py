"""A scene for pictures: robot and clutter are placed as a reach had them; also in a Meshcat."""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    Cylinder,
    Meshcat,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.meshcat import ContactVisualizer, ContactVisualizerParams
from pydrake.systems.framework import Context, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import SceneState
from lic_drake.scene.scene import Scene, add_scene
from lic_drake.show.pr2_meshes import attach_pr2_meshes
from lic_drake.types import Vector

NEUTRAL = Rgba(0.0, 0.7, 0.8, 0.9)
"""Colour of a goal."""


FLOOR_THICKNESS_M = 0.02
"""Its upper face is the floor, metres."""

# Meshcat's light fades further away.
_FLOOR, _FLOOR_COLOR = Box(4.0, 4.0, FLOOR_THICKNESS_M), Rgba(0.86, 0.86, 0.88, 1.0)
_SCENE, _FORCES = "/drake", "/drake/contact_forces"
_PLANE_VIEW = (np.array([-0.4, -0.3, 1.05]), np.array([0.45, 0.02, 0.0]))
_SPACE_VIEW = (np.array([-0.45, -1.65, 1.65]), np.array([0.4, -0.15, 0.85]))


def floor_centre(in_plane: bool) -> Vector:
    """Returns the centre of the floor in W, shape (3,), metres.

    Cylinders of the plane stand with their middle at z = 0.
    """
    return np.array([0.0, 0.0, (-0.13 if in_plane else 0.0) - 0.5 * FLOOR_THICKNESS_M])


def add_stage(
    builder: DiagramBuilder,
    scenario: Scenario,
    instance: ClutterInstance,
    drake_models: Path | None = None,
) -> Scene:
    """Adds plant and scene graph of an environment with a robot that `place` can place.

    Contact forces follow from the state alone, since the plant is continuous. With `drake_models`,
    the folder of package://drake_models, a PR2 has its meshes; a ModelError says that they cannot
    be read.
    """
    config = replace(scenario.scene, time_step_s=0.0)
    scene = add_scene(builder, scenario.arm(), instance, config, visuals=True, mobile=True)
    if drake_models is not None:
        attach_pr2_meshes(scene, drake_models)
    return scene


def place(
    scene: Scene, root: Context, b0: Vector, q: Vector, state: SceneState | None = None
) -> None:
    """Places the robot of a mobile scene, in a context of the diagram that has the scene.

    A state gives the joint velocities, otherwise zero, and the state of the clutter.
    """
    plant = scene.plant
    context = plant.GetMyMutableContextFromRoot(root)
    plant.SetPositions(context, scene.arm, scene.robot.positions(b0, q))
    v = np.zeros(len(q)) if state is None else state.v
    plant.SetVelocities(context, scene.arm, scene.robot.positions(np.zeros(3), v))
    if state is not None:
        plant.SetPositions(context, scene.clutter, state.q_clutter.ravel())
        plant.SetVelocities(context, scene.clutter, state.v_clutter.ravel())


class Screen:
    """Draws one environment into a Meshcat, in place of what another screen drew there.

    Attributes:
        initial: Joint angles that the arm's model has by default, shape (m,), radians.
    """

    def __init__(
        self,
        meshcat: Meshcat,
        scenario: Scenario,
        instance: ClutterInstance,
        drake_models: Path | None = None,
    ) -> None:
        """Builds the scene; for `drake_models` see `add_stage`."""
        self._meshcat = meshcat
        self._radius_m = scenario.stop.success_distance_m
        builder = DiagramBuilder()
        self._scene = scene = add_stage(builder, scenario, instance, drake_models)
        shown = MeshcatVisualizerParams(role=Role.kIllustration)
        MeshcatVisualizer.AddToBuilder(builder, scene.scene_graph, meshcat, shown)
        arrows = ContactVisualizerParams(newtons_per_meter=50.0, force_threshold=0.05, radius=0.003)
        ContactVisualizer.AddToBuilder(builder, scene.plant, meshcat, arrows)
        self._diagram = builder.Build()
        self._context = self._diagram.CreateDefaultContext()
        # Only now, so that there is no gap between the last scene and this one.
        meshcat.Delete(_SCENE)
        self.initial: Vector = scene.plant.GetDefaultPositions(scene.arm)[3:]

    def draw(
        self, b0: Vector, q: Vector, state: SceneState | None = None, time_s: float = 0.0
    ) -> None:
        """Draws the robot with base and torso at b0, shape (3,), and joint angles q, shape (m,).

        A state moves the clutter and gives the contact forces; see `place`.
        """
        place(self._scene, self._context, b0, q, state)
        self._context.SetTime(time_s)
        self._diagram.ForcedPublish(self._context)

    def draw_goal(self, p_WG: Vector, color: Rgba = NEUTRAL) -> None:
        """Draws the goal, as large as what counts as reached, on a pole."""
        for name, shape in (("goal", Sphere(self._radius_m)), ("pole", Cylinder(0.002, 0.3))):
            self._meshcat.SetObject(f"/task/{name}", shape, color)
            self._meshcat.SetTransform(f"/task/{name}", RigidTransform(p_WG))

    def show_forces(self, visible: bool, time_s: float | None = None) -> None:
        """Shows or hides contact forces, in a recording from a time on, seconds."""
        self._meshcat.SetProperty(_FORCES, "visible", visible, time_s)


def look(meshcat: Meshcat, in_plane: bool) -> None:
    """Looks at an arm in the plane or in space."""
    meshcat.SetCameraPose(*(_PLANE_VIEW if in_plane else _SPACE_VIEW))


def open_meshcat(in_plane: bool, port: int | None = None) -> Meshcat:
    """Returns a Meshcat that looks at an arm in the plane or in space, without logging its address.

    A RuntimeError says that the port cannot be opened; by default it is the first free one.
    """
    logger = logging.getLogger("drake")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        meshcat = Meshcat(MeshcatParams(port=port, show_stats_plot=False))
    finally:
        logger.setLevel(level)
    for end in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", end, [0.97, 0.97, 0.98])
    meshcat.SetObject("/floor", _FLOOR, _FLOOR_COLOR)
    meshcat.SetTransform("/floor", RigidTransform(floor_centre(in_plane)))
    for hidden in ("/Grid", "/Axes"):
        meshcat.SetProperty(hidden, "visible", False)
    look(meshcat, in_plane)
    return meshcat
