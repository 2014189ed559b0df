"""A reach under way, and the loop that runs it to its end."""

import gc
import math
from collections import Counter, deque
from collections.abc import Callable, Hashable

import numpy as np

from lic_drake.reach.rig import Rig, Stepper
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.task import StopConfig
from lic_drake.reach.trace import ReachResult, ReachTrace, SceneState
from lic_drake.scene.collision import is_touching
from lic_drake.types import Vector


class Simulation:
    """What `simulate` runs: here all is simulated; what sleeps or another engine is a subclass."""

    _stepper: Stepper | None = None

    def __init__(self, rig: Rig) -> None:
        self._rig = rig

    def begin(self, q: Vector, p_RG: Vector) -> None:
        """Puts the arm at rest at q, (m,), and everything movable where the environment has it."""
        self._begin_in(self._rig, q, p_RG)

    def _begin_in(self, rig: Rig, q: Vector, p_RG: Vector, time_s: float = 0.0) -> None:
        self._rig, self._p_RG = rig, p_RG
        rig.context.SetTime(time_s)
        rig.diagram.set_start(rig.context, q, p_RG)
        first = rig.q_clutter_first
        rig.set_state(rig.state()._replace(q_clutter=first, v_clutter=np.zeros_like(first)))
        self._earlier = self.statistics() if time_s > 0.0 else Counter()
        self._stepper = None

    def statistics(self) -> Counter[str]:
        """Returns what `Stepper.statistics` counts, for the reach so far."""
        return self._earlier + (self._stepper.statistics() if self._stepper else Counter())

    def is_in_collision(self) -> bool:
        """Returns whether the arm touches anything."""
        return is_touching(self._rig.scene, self._rig.context)

    def advance_to(self, time_s: float) -> None:
        """Simulates up to a time, without the control update of that instant.

        Raises:
            RuntimeError: Drake found no solution, or a system failed.
        """
        if self._stepper is None:
            # A new one, because an integrator's memory would make a reach depend on the one before.
            self._stepper = Stepper(self._rig)
        self._stepper.advance_to(time_s)

    def joint_angles(self) -> Vector:
        """Returns the arm's q, shape (m,), radians."""
        return self._rig.plant.GetPositions(self._rig.plant_context, self._rig.scene.arm)

    def taxel_force(self) -> Vector:
        """Returns the sensor's reading, shape (num_taxels,), N."""
        return self._rig.taxel_force()

    def state(self) -> SceneState:
        """Returns the state of the arm and of everything movable, asleep or awake."""
        return self._rig.state()

    def wake_near(self, q: Vector) -> None:
        """Wakes what the arm at joint angles q may touch before the next control update."""


class Cache[T](dict[Hashable, T]):
    """The most recently used items, at most `size` of them; then half of them are dropped.

    Diagrams with Python systems are reference cycles, which only Python's collector frees: where
    items are `cyclic`, it runs when they are dropped.
    """

    def __init__(self, size: int, cyclic: bool = False) -> None:
        self.size, self._cyclic = size, cyclic

    def obtain(self, key: Hashable, make: Callable[[], T]) -> T:
        """Returns the item of a key, made when it is missing."""
        item = self.pop(key) if key in self else make()  # Which may itself obtain others.
        if len(self) >= self.size:
            for old in list(self)[: (self.size + 1) // 2]:
                del self[old]
            if self._cyclic:
                gc.collect()
        self[key] = item
        return item


class StopMonitor:
    """Follows a reach sample by sample and says when and how it ends."""

    def __init__(self, config: StopConfig, p_WG: Vector, period_s: float) -> None:
        self._config = config
        self._p_WG = p_WG
        # Tip positions and smallest distances from now back to so long ago, at the control period.
        self._recent: deque[Vector] = deque(maxlen=_samples(config, period_s, config.stuck_time_s))
        self._nearest: deque[float] = deque(
            maxlen=_samples(config, period_s, config.progress_time_s)
        )
        self._low_force_time_s = 0.0
        self.min_distance = np.inf

    def update(self, time_s: float, p_WE: Vector, peak_force: float) -> str | None:
        """Takes the largest taxel force, N, at a time and tip position p_WE, shape (3,), metres.

        Returns:
            The outcome if the reach ends with this sample, else None.
        """
        self._recent.append(p_WE)
        distance = math.dist(p_WE, self._p_WG)
        self.min_distance = min(self.min_distance, distance)
        if distance < self._config.success_distance_m:
            return "reached"
        if peak_force <= self._config.force_limit_N:
            self._low_force_time_s = time_s
        elif time_s - self._low_force_time_s >= self._config.force_time_s - 1e-9:
            return "force"
        if len(self._recent) == self._recent.maxlen:
            if math.dist(self._recent[-1], self._recent[0]) < self._config.stuck_distance_m:
                return "stuck"
        self._nearest.append(self.min_distance)
        if len(self._nearest) == self._nearest.maxlen:
            if self._nearest[0] - self.min_distance < self._config.progress_m:
                return "stuck"
        if time_s >= self._config.timeout_s - 1e-9:
            return "timeout"
        return None


def _samples(config: StopConfig, period_s: float, window_s: float) -> int:
    """Returns how many samples a window holds; one longer than the time-out never fills."""
    return max(1, round(min(window_s, config.timeout_s + period_s) / period_s)) + 1


def simulate(
    simulation: Simulation,
    scenario: Scenario,
    q0: Vector,
    p_RG: Vector,
    keep_states: bool = False,
) -> ReachResult:
    """Runs a simulation from rest at q0, (m,), radians, until a stop rule of the scenario ends it.

    The goal p_RG has shape (3,), metres. With `keep_states` the trace holds the whole scene.
    """
    arm, period_s = scenario.arm(), scenario.mpc.period_s
    simulation.begin(q0, p_RG)
    trace = ReachTrace()
    if simulation.is_in_collision():
        return ReachResult("invalid_start", trace, "the arm touches the clutter at its start")
    monitor = StopMonitor(scenario.stop, p_RG, period_s)
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
