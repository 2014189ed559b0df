"""The reach diagram: arm and clutter wired to the tactile sensor and the MPC."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context, Diagram, DiagramBuilder

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.surface_taxels import make_taxels
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.reach.scenario import Scenario
from lic_drake.scene.furnish import raise_torso
from lic_drake.scene.scene import Scene, add_scene
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class ReachDiagram:
    """A built diagram and what a rollout needs of it.

    The diagram's input port is `goal` (p_WG, 3); its output ports are `arm_state` ([q, v]),
    `clutter_state` ([p, v] of the movable objects), `taxel_force` and `desired_state`. The height
    of the torso is a parameter.
    """

    diagram: Diagram
    scene: Scene
    sensor: TactileSensor
    controller: HapticMpcController
    torso_frame: str

    def set_start(self, context: Context, q: Vector, p_WG: Vector) -> None:
        """Puts the arm at rest at q, with the goal p_WG, in a context of the diagram."""
        plant = self.scene.plant
        x = np.append(q, np.zeros(len(q)))
        plant.SetPositionsAndVelocities(
            plant.GetMyMutableContextFromRoot(context), self.scene.arm, x
        )
        self.controller.set_equilibrium(self.controller.GetMyMutableContextFromRoot(context), q)
        self.diagram.GetInputPort("goal").FixValue(context, p_WG)

    def set_torso(self, context: Context, torso_m: float) -> None:
        """Puts the torso that carries the arm at a height, metres, in a context of the diagram."""
        if self.torso_frame:
            raise_torso(self.scene, context, self.torso_frame, torso_m)
        for system in (self.sensor, self.controller):
            system.arm.raise_to(system.GetMyMutableContextFromRoot(context), torso_m)


def make_reach_diagram(
    scenario: Scenario,
    instance: ClutterInstance,
    torso_m: float | None = None,
) -> ReachDiagram:
    """Builds the diagram of one environment.

    Args:
        scenario: Robot, contact, controller.
        instance: The clutter.
        torso_m: Height of the robot's torso, metres; by default as the scenario's task has it.
    """
    builder = DiagramBuilder()
    arm = scenario.arm(torso_m)
    layout = make_taxels(arm, scenario.scene.taxels_per_m)
    scene = add_scene(
        builder,
        arm,
        instance,
        scenario.scene,
    )
    plant = scene.plant
    plant.set_name("plant")

    sensor = TactileSensor(arm, layout, scene.skin_links, scene.body)
    builder.AddNamedSystem("sensor", sensor)
    builder.Connect(plant.get_contact_results_output_port(), sensor.GetInputPort("contact_results"))
    builder.Connect(plant.get_state_output_port(scene.arm), sensor.GetInputPort("arm_state"))

    controller = HapticMpcController(arm, layout, scenario.mpc)
    builder.AddNamedSystem("controller", controller)
    builder.Connect(plant.get_state_output_port(scene.arm), controller.GetInputPort("arm_state"))
    builder.Connect(sensor.GetOutputPort("taxel_force"), controller.GetInputPort("taxel_force"))
    builder.Connect(
        controller.GetOutputPort("desired_state"), plant.get_desired_state_input_port(scene.arm)
    )
    builder.ExportInput(controller.GetInputPort("goal"), "goal")

    builder.ExportOutput(plant.get_state_output_port(scene.arm), "arm_state")
    builder.ExportOutput(plant.get_state_output_port(scene.clutter), "clutter_state")
    builder.ExportOutput(sensor.GetOutputPort("taxel_force"), "taxel_force")
    builder.ExportOutput(controller.GetOutputPort("desired_state"), "desired_state")

    diagram = builder.Build()
    diagram.set_name("reach")
    return ReachDiagram(
        diagram=diagram,
        scene=scene,
        sensor=sensor,
        controller=controller,
        torso_frame=arm.torso_frame,
    )
