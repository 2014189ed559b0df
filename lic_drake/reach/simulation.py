"""A reach under way: the context of a reach diagram, and the loop that runs it to its end."""

import gc
import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Protocol

import numpy as np
from pydrake.systems.analysis import Simulator

from lic_drake.reach.diagram import ReachDiagram
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.stop_rules import StopMonitor
from lic_drake.reach.trace import ReachResult, ReachTrace, SceneState
from lic_drake.scene.collision import is_touching
from lic_drake.types import Vector


class Simulated(Protocol):
    """What `simulate` needs: a `Simulation`, one with sleeping objects, or another engine's."""

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q and every object where the environment has it.

        Args:
            q: Joint angles, shape (m,), radians.
            p_RG: Goal, shape (3,), metres.
        """

    def is_in_collision(self) -> bool:
        """Returns whether the arm touches anything."""

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time, without the control update of that instant.

        Raises:
            RuntimeError: Drake found no solution, or a system failed.
        """

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""

    def state(self) -> SceneState:
        """Returns the state of the arm and of all movable objects."""

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""


class Simulation:
    """The arm and the clutter of one diagram, used for one reach after another.

    The context is kept, because creating one costs as much as some ten control periods.

    Attributes:
        diagram: The diagram.
        context: Its context.
        plant_context: That of the plant.
        num_movable: Number of movable objects.
        shown: Whose fixed objects the context has; for who changes them.
    """

    def __init__(self, diagram: ReachDiagram) -> None:
        self.diagram = diagram
        self.context = diagram.diagram.CreateDefaultContext()
        scene = diagram.scene
        self._plant, self._arm, self._clutter = scene.plant, scene.arm, scene.clutter
        self.plant_context = scene.plant.GetMyMutableContextFromRoot(self.context)
        self._num_axes = scene.num_axes
        self._p_WO_first = self.object_positions().copy()
        self.num_movable = len(self._p_WO_first)
        self.shown: object = None
        self._taxel_force = diagram.diagram.GetOutputPort("taxel_force")

    def begin(self, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        """Puts the arm at rest at q and every object where the environment has it.

        Args:
            q: Joint angles, shape (m,), radians.
            p_RG: Goal, shape (3,), metres.
            time_s: Time on the clock, seconds.
        """
        self.context.SetTime(time_s)
        self.diagram.set_start(self.context, q, p_RG)
        p_WO = self._p_WO_first
        self.set_state(self.state()._replace(p_WO=p_WO, v_WO=np.zeros_like(p_WO)))
        self._simulator: Simulator | None = None

    def is_in_collision(self) -> bool:
        """Returns whether the arm touches anything."""
        return is_touching(self.diagram.scene, self.context)

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time, without the control update of that instant."""
        if self._simulator is None:
            # A new one, because an integrator's memory would make a reach depend on the one before.
            self._simulator = self.diagram.make_simulator(self.context)
            self._simulator.Initialize()
        self._simulator.AdvanceTo(time_s)

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self._plant.GetPositions(self.plant_context, self._arm)

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return np.asarray(self._taxel_force.Eval(self.context))

    def object_positions(self) -> Vector:
        """Returns p_WO of the movable objects, shape (n, num_axes), metres."""
        p_WO = self._plant.GetPositions(self.plant_context, self._clutter)
        return p_WO.reshape(-1, self._num_axes)

    def state(self) -> SceneState:
        """Returns the state of the arm and of the movable objects."""
        plant, context = self._plant, self.plant_context
        return SceneState(
            q=plant.GetPositions(context, self._arm),
            v=plant.GetVelocities(context, self._arm),
            p_WO=plant.GetPositions(context, self._clutter).reshape(-1, self._num_axes),
            v_WO=plant.GetVelocities(context, self._clutter).reshape(-1, self._num_axes),
        )

    def set_state(self, state: SceneState) -> None:
        """Sets the state of the arm and of the movable objects."""
        plant, context = self._plant, self.plant_context
        plant.SetPositions(context, self._arm, state.q)
        plant.SetVelocities(context, self._arm, state.v)
        plant.SetPositions(context, self._clutter, state.p_WO.ravel())
        plant.SetVelocities(context, self._clutter, state.v_WO.ravel())

    def wake_near(self, q: Vector) -> None:
        """Does nothing: every movable object is simulated."""


class Cache[T]:
    """The most recently used items, at most a number of them, by key.

    Diagrams with Python systems are reference cycles, which only Python's collector frees: it runs
    when items are dropped, which happens to half of them at once.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self._items = OrderedDict[Hashable, T]()

    def __len__(self) -> int:
        return len(self._items)

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Returns the item of a key, made when it is missing."""
        if key not in self._items:
            item = make()  # Which may itself get others.
            if len(self._items) >= self.size:
                for _ in range((self.size + 1) // 2):
                    self._items.popitem(last=False)
                gc.collect()
            self._items[key] = item
        self._items.move_to_end(key)
        return self._items[key]

    def clear(self) -> None:
        """Drops all items."""
        self._items.clear()
        gc.collect()


def find_free(simulation: Simulated, angles: Vector, p_RG: Vector) -> Vector | None:
    """Returns the first joint angles with which the arm touches nothing, shape (m,), or None.

    Args:
        simulation: The environment.
        angles: Joint angles to try, shape (n, m), radians.
        p_RG: Goal, shape (3,), metres.
    """
    for q in angles:
        simulation.begin(q, p_RG)
        if not simulation.is_in_collision():
            return q
    return None


def simulate(
    simulation: Simulated,
    scenario: Scenario,
    q0: Vector,
    p_RG: Vector,
    keep_states: bool = False,
) -> ReachResult:
    """Runs a simulation from rest at q0 until a stop rule ends it.

    Args:
        simulation: The environment.
        scenario: Gives the arm, the control period and the stop rules.
        q0: First joint angles, shape (m,), radians.
        p_RG: Goal, shape (3,), metres.
        keep_states: Whether the trace is to hold the whole scene.
    """
    arm, period_s = scenario.arm(), scenario.mpc.period_s
    simulation.begin(q0, p_RG)
    if simulation.is_in_collision():
        return ReachResult(
            "invalid_start", ReachTrace(), "the arm touches the clutter at its start"
        )
    monitor = StopMonitor(scenario.stop, p_RG, period_s)
    trace = ReachTrace()
    step = 0
    while True:
        # Drake's own arithmetic for periodic events: no rounding error decides whether a sample
        # comes before or after the events of its instant.
        time_s = step * period_s
        try:
            simulation.advance_to(time_s)
            q = simulation.joint_angles()
            # Reading the taxels solves the contacts of this instant, which can fail, too.
            forces = simulation.taxel_force()
        except (ArithmeticError, RuntimeError, ValueError) as error:
            return ReachResult("diverged", trace, " ".join(str(error).split())[:200])
        if not all(map(math.isfinite, q)):
            return ReachResult("diverged", trace, "joint angles are not finite")
        p_RE = arm.calc_pose(q).p_RE
        trace.append(time_s, q, p_RE, forces)
        if keep_states:
            trace.states.append(simulation.state())
        outcome = monitor.update(time_s, p_RE, trace.peak_force[-1])
        if outcome is not None:
            return ReachResult(outcome, trace)
        simulation.wake_near(q)
        step += 1
