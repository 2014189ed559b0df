"""A simulation in which movable objects sleep, fixed, until the arm comes near them."""

from abc import ABC, abstractmethod

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.simulation_pool import SimulationPool
from lic_drake.reach.trace import SceneState
from lic_drake.scene.sleep import SkinAxes, SleepMonitor, put_to_sleep
from lic_drake.types import Vector

FEWEST_SPARES = 2
"""Spare objects of the first diagram that has any; every further one has twice as many. Their
number is part of a record's last digits: more spares than before, in one of ten reaches of the PR2
the solver adds in another order."""


class PartlyAsleep(ABC):
    """A simulation without what sleeps in it, used as a `Simulation`."""

    _now: Simulation
    _p_RG: Vector

    @abstractmethod
    def begin(self, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        """Puts the arm at rest at q and every object where the environment has it.

        Args:
            q: Joint angles, shape (m,), radians.
            p_RG: Goal, shape (3,), metres.
            time_s: Time on the clock, seconds.
        """

    @abstractmethod
    def state(self) -> SceneState:
        """Returns the present state of the arm and of all movable objects."""

    @abstractmethod
    def look_around(self, q: Vector) -> None:
        """Wakes what has to be awake before the simulation goes on.

        Args:
            q: The present joint angles, shape (m,), radians.

        Raises:
            MovedTooFarError: An object may have been touched while it was asleep.
        """

    def is_in_collision(self) -> bool:
        """Tells whether the arm touches anything now."""
        return self._now.is_in_collision()

    def find_free(self, angles: Vector) -> Vector | None:
        """Returns the first joint angles with which the arm touches nothing; see `Simulation`."""
        for q in angles:
            self.begin(q, self._p_RG)
            if not self.is_in_collision():
                free: Vector = q
                return free
        return None

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time; see `Simulation.advance_to`."""
        self._now.advance_to(time_s)

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self._now.joint_angles()

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return self._now.taxel_force()


class WakingSimulation(PartlyAsleep):
    """A `Simulation` of an environment with all its movable objects, most of them asleep.

    Those are left out; for an object that wakes up a spare takes its place. When the spares do not
    suffice, the reach goes on in a diagram with more of them.
    """

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        height_m: float = 0.0,
        pool: SimulationPool | None = None,
    ) -> None:
        self._scenario = scenario
        self._pool = SimulationPool() if pool is None else pool
        self._instance = instance
        self._height_m = height_m
        self._axes = SkinAxes(scenario.arm(), instance.num_axes)
        self._num_movable = int(np.count_nonzero(instance.movable))
        self._asleep: dict[int, ClutterInstance] = {}

    def begin(self, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        """Puts the arm at rest at q and every object where the environment has it."""
        self._p_RG = p_RG
        self._awake: list[int] = []  # In the order of the spares that stand for them.
        self._monitor = SleepMonitor(self._instance, self._axes, q)
        self._now = self._with_spares(0)
        self._now.begin(q, p_RG, time_s)
        self.look_around(q)

    def state(self) -> SceneState:
        """Returns the present state of the arm and of all movable objects."""
        now, n = self._now.state(), len(self._awake)
        p_WO, v_WO = self._monitor.p_WO.copy(), np.zeros_like(self._monitor.p_WO)
        if n:
            p_WO[self._awake], v_WO[self._awake] = now.p_WO[:n], now.v_WO[:n]
        return SceneState(q=now.q, v=now.v, p_WO=p_WO, v_WO=v_WO)

    def look_around(self, q: Vector) -> None:
        """Wakes what has to be awake before the simulation goes on."""
        woken = self._monitor.look(q, self._now.object_positions()[: len(self._awake)])
        if woken:
            self._wake(woken)

    def _wake(self, woken: list[int]) -> None:
        """Lets spares take the places of objects."""
        before, state = self._now, self.state()
        self._awake += woken
        n = len(self._awake)
        if n > before.num_movable:
            self._now = self._with_spares(self._enough_spares(n))
            self._now.begin(state.q, self._p_RG, before.time_s)
            self._now.take_over_control(before)
        spares = self._now.state()
        p_WO, v_WO = spares.p_WO.copy(), spares.v_WO.copy()
        p_WO[:n], v_WO[:n] = state.p_WO[self._awake], state.v_WO[self._awake]
        self._now.set_state(SceneState(q=state.q, v=state.v, p_WO=p_WO, v_WO=v_WO))

    def _with_spares(self, spares: int) -> Simulation:
        if spares not in self._asleep:
            self._asleep[spares] = put_to_sleep(self._instance, spares)
        return self._pool.get(self._scenario, self._asleep[spares], self._height_m)

    def _enough_spares(self, awake: int) -> int:
        spares = FEWEST_SPARES
        while spares < awake:
            spares *= 2
        return min(spares, self._num_movable)
