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

    def get(self, scenario: Scenario, instance: ClutterInstance, height_m: float) -> Simulation:
        """Returns a simulation of an instance, with R at a height above the robot's floor.

        Args:
            scenario: Robot, contact, controller.
            instance: The clutter.
            height_m: Height of R, metres.
        """
        key = (scenario.digest, *_kind(instance))
        if key not in self._simulations:
            if len(self._simulations) >= MAX_SIMULATIONS:
                self._simulations.clear()
                # Diagrams with Python systems are reference cycles: only the collector frees them.
                gc.collect()
            diagram = make_reach_diagram(scenario, instance, height_m=height_m)
            self._simulations[key] = Simulation(diagram, scenario.scene)
        simulation = self._simulations[key]
        simulation.furnish(instance, scenario.arm(), height_m)
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
