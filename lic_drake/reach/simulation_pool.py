"""`SimulationPool`: simulations that one environment after another uses."""

import gc

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation

MAX_SIMULATIONS = 16
"""Simulations that a pool keeps, some MB each."""


class SimulationPool:
    """Keeps simulations for other environments with as many fixed and the same movable objects.

    Building one takes as long as simulating a second of the PR2. It must not be asked for one while
    a reach in the same kind of environment is under way.
    """

    def __init__(self) -> None:
        self._simulations: dict[tuple[object, ...], Simulation] = {}

    def get(
        self, scenario: Scenario, instance: ClutterInstance, torso_m: float | None
    ) -> Simulation:
        """Returns a simulation of an instance, with the torso at a height.

        Args:
            scenario: Robot, contact, controller.
            instance: The clutter.
            torso_m: Height of the torso, metres; None as the scenario's task has it.
        """
        key = (scenario.digest, *_kind(instance))
        if key not in self._simulations:
            if len(self._simulations) >= MAX_SIMULATIONS:
                self._simulations.clear()
                # Diagrams with Python systems are reference cycles: only the collector frees them.
                gc.collect()
            diagram = make_reach_diagram(scenario, instance, torso_m=torso_m)
            self._simulations[key] = Simulation(diagram, scenario.scene)
        simulation = self._simulations[key]
        simulation.furnish(instance, scenario.arm(torso_m).torso_m)
        return simulation


def _kind(instance: ClutterInstance) -> tuple[object, ...]:
    """Returns what cannot be changed any more when a diagram is built."""
    movable = instance.movable
    return (
        movable.tobytes(),
        tuple(instance.shape[i] for i in movable.nonzero()[0]),
        *(
            values[movable].tobytes()
            for values in (instance.size, instance.p_WO, instance.yaw, instance.mass)
        ),
    )
