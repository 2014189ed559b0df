"""A simulation that leaves stems out until the arm comes near them."""

import gc
from dataclasses import replace

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.trace import SceneState
from lic_drake.reach.waking import PartlyAsleep
from lic_drake.scene.sleep import SkinAxes
from lic_drake.scene.stem_sleep import StemMonitor
from lic_drake.types import Vector

MAX_DIAGRAMS = 8
"""Diagrams that are kept, each with other stems awake."""


class StemWakingSimulation(PartlyAsleep):
    """A `Simulation` of an environment with all its stems, most of them asleep.

    When the arm comes near a stem, the reach goes on in a diagram that has it, too.
    """

    def __init__(self, scenario: Scenario, instance: ClutterInstance, height_m: float) -> None:
        assert instance.stems is not None
        self._scenario = scenario
        self._instance = instance
        self._stems = instance.stems
        self._height_m = height_m
        self._axes = SkinAxes(scenario.arm(), num_axes=3)
        self._springy = ~self._stems.fixed
        self._diagrams: dict[bytes, Simulation] = {}

    def begin(self, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        """Puts the arm at rest at q and every stem upright."""
        self._p_RG = p_RG
        self._monitor = StemMonitor(self._stems, self._axes)
        self._monitor.wake_near(q)
        self._now = self._with_awake()
        self._now.begin(q, p_RG, time_s)

    def state(self) -> SceneState:
        """Returns the present state of the arm and of all stems that can bend."""
        now = self._now.state()
        shape = (np.count_nonzero(self._springy), now.p_WO.shape[1])
        angles, rates = np.zeros(shape), np.zeros(shape)
        awake = self._monitor.is_awake[self._springy]
        angles[awake], rates[awake] = now.p_WO, now.v_WO
        return SceneState(q=now.q, v=now.v, p_WO=angles, v_WO=rates)

    def look_around(self, q: Vector) -> None:
        """Wakes what has to be awake before the simulation goes on."""
        before, state = self._now, self.state()
        if not self._monitor.look(q).any():
            return
        awake = self._monitor.is_awake[self._springy]
        self._now = self._with_awake()
        self._now.begin(state.q, self._p_RG, before.time_s)
        self._now.take_over_control(before)
        self._now.set_state(state._replace(p_WO=state.p_WO[awake], v_WO=state.v_WO[awake]))

    def _with_awake(self) -> Simulation:
        awake = self._monitor.is_awake
        key = awake.tobytes()
        if key not in self._diagrams:
            if len(self._diagrams) >= MAX_DIAGRAMS:
                self._diagrams.clear()
                # Diagrams with Python systems are reference cycles: only the collector frees them.
                gc.collect()
            present = replace(self._instance, stems=self._stems.subset(awake))
            diagram = make_reach_diagram(self._scenario, present, height_m=self._height_m)
            self._diagrams[key] = Simulation(diagram, self._scenario.scene)
        return self._diagrams[key]
