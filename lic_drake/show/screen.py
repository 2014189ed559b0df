"""One environment in a Meshcat: robot, clutter, goal and contact forces, state by state."""

import logging
from pathlib import Path

import numpy as np
from pydrake.geometry import (
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
from pydrake.systems.framework import DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import SceneState
from lic_drake.show.stage import add_stage, place
from lic_drake.types import Vector

NEUTRAL = Rgba(0.0, 0.7, 0.8, 0.9)
"""Colour of a goal."""

_SCENE, _FORCES = "/drake", "/drake/contact_forces"
_PLANE_VIEW = (np.array([-0.4, -0.3, 1.05]), np.array([0.45, 0.02, 0.0]))
_SPACE_VIEW = (np.array([-0.45, -1.65, 1.65]), np.array([0.4, -0.15, 0.85]))


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
        """Builds the scene; for `drake_models` see `lic_drake.show.stage.add_stage`."""
        meshcat.Delete(_SCENE)
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
        self.initial: Vector = scene.plant.GetDefaultPositions(scene.arm)[3:]

    def draw(
        self, b0: Vector, q: Vector, state: SceneState | None = None, time_s: float = 0.0
    ) -> None:
        """Draws the robot with base and torso at b0, shape (3,), and joint angles q, shape (m,).

        A state moves the clutter and gives the contact forces; see `lic_drake.show.stage.place`.
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
    for hidden in ("/Grid", "/Axes"):
        meshcat.SetProperty(hidden, "visible", False)
    meshcat.SetCameraPose(*(_PLANE_VIEW if in_plane else _SPACE_VIEW))
    return meshcat
