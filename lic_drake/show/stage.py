"""A scene for pictures: robot and clutter are placed as a reach had them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from pydrake.systems.framework import Context, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import SceneState
from lic_drake.scene.scene import Scene, add_scene
from lic_drake.show.pr2_meshes import attach_pr2_meshes
from lic_drake.types import Vector


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
