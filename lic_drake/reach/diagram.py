"""The reach diagram: arm and clutter wired to the tactile sensor and the MPC."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, LeafSystem

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.mpc import MpcConfig
from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.control.taxels import TaxelLayout, make_taxels
from lic_drake.reach.scenario import Scenario
from lic_drake.robots.arm import Arm
from lic_drake.scene.scene import Scene, SceneConfig, add_scene, make_simulator
from lic_drake.types import Vector


@dataclass(frozen=True)
class ReachDiagram:
    """A built diagram and what a rollout needs of it; its ports are in control/README.md.

    Its world is the robot's frame R. Its input port is `goal` (p_RG, 3); its output ports are
    `arm_state` ([q, v]), `clutter_state` ([p, v] of the movable objects), `taxel_force` and
    `desired_state`.
    """

    diagram: Diagram
    scene: Scene
    config: SceneConfig
    controller: LeafSystem

    def set_start(self, context: Context, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q, with the goal p_RG, in a context of the diagram."""
        plant_context = self.scene.plant.GetMyMutableContextFromRoot(context)
        x = np.append(q, np.zeros(len(q)))
        self.scene.plant.SetPositionsAndVelocities(plant_context, self.scene.arm, x)
        self.controller.GetMyMutableContextFromRoot(context).SetDiscreteState(x)
        self.diagram.GetInputPort("goal").FixValue(context, p_RG)

    def make_simulator(self, context: Context | None = None) -> Simulator:
        """Returns a simulator with the scenario's integrator, by default of a new context.

        A plain `Simulator(diagram)` would integrate a continuous plant by Runge-Kutta instead.
        """
        return make_simulator(self.diagram, self.config, context)


def make_reach_diagram(
    scenario: Scenario,
    instance: ClutterInstance,
    height_m: float | None = None,
    controller: Callable[[Arm, TaxelLayout, MpcConfig], LeafSystem] = HapticMpcController,
) -> ReachDiagram:
    """Builds the diagram of one environment, with the clutter in R.

    R is `height_m` above the robot's floor, which only moves the robot's body; by default as the
    task has it. `controller` makes a system with the ports of `HapticMpcController`, whose one
    discrete state is `desired_state`; where a port is missing or has another size, Drake says so in
    a RuntimeError.
    """
    builder = DiagramBuilder()
    arm = scenario.arm()
    layout = make_taxels(arm, scenario.scene.taxels_per_m)
    height_m = scenario.task.torso_m if height_m is None else height_m
    scene = add_scene(builder, arm, instance, scenario.scene, height_m=height_m)
    plant = scene.plant
    plant.set_name("plant")
    sensor = TactileSensor(arm, layout, scene.skin_links, scene.body)
    builder.AddNamedSystem("sensor", sensor)
    mover = controller(arm, layout, scenario.mpc)
    builder.AddNamedSystem("controller", mover)

    outputs = {
        "arm_state": plant.get_state_output_port(scene.arm),
        "clutter_state": plant.get_state_output_port(scene.clutter),
        "taxel_force": sensor.GetOutputPort("taxel_force"),
        "desired_state": mover.GetOutputPort("desired_state"),
    }
    builder.Connect(plant.get_contact_results_output_port(), sensor.GetInputPort("contact_results"))
    builder.Connect(outputs["arm_state"], sensor.GetInputPort("arm_state"))
    for name in ("arm_state", "taxel_force"):
        builder.Connect(outputs[name], mover.GetInputPort(name))
    builder.Connect(outputs["desired_state"], plant.get_desired_state_input_port(scene.arm))
    builder.ExportInput(mover.GetInputPort("goal"), "goal")
    for name, port in outputs.items():
        builder.ExportOutput(port, name)

    diagram = builder.Build()
    diagram.set_name("reach")
    return ReachDiagram(diagram, scene, scenario.scene, mover)
