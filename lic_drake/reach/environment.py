"""`Environment`: the diagrams of one drawn environment, and reaches simulated in them."""

import math
from contextlib import suppress

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.request import is_within_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.simulation_pool import SimulationPool
from lic_drake.reach.start import Start
from lic_drake.reach.stem_waking import StemWakingSimulation
from lic_drake.reach.stop_rules import StopMonitor
from lic_drake.reach.trace import ReachResult, ReachTrace
from lic_drake.reach.waking import PartlyAsleep, WakingSimulation
from lic_drake.robots.arm import Arm
from lic_drake.scene.sleep import MovedTooFarError, can_sleep
from lic_drake.types import Vector


class Environment:
    """One environment of a scenario with its diagrams, used for many reaches.

    Args:
        scenario: Robot, contact, controller, stop rules.
        instance: The clutter.
        sleep: Whether objects may sleep until the arm comes near; without, a reach costs three
            times as much and ends the same.
        b0: Base position and torso height, (x, y, z), shape (3,), metres; by default at the origin
            with the torso as the scenario's task has it.
        pool: Simulations that may be used; by default its own.

    The simulated world is the robot's frame R, which b0 carries and which stands still during a
    reach: the environment is moved by -b0 instead (T_b0 of paper Eq. 3).
    """

    def __init__(
        self,
        scenario: Scenario,
        instance: ClutterInstance,
        sleep: bool = True,
        b0: Vector | None = None,
        pool: SimulationPool | None = None,
    ) -> None:
        self.scenario = scenario
        self.instance = instance
        self.arm = scenario.arm()
        self.b0 = np.array([0.0, 0.0, scenario.task.torso_m]) if b0 is None else b0
        self.arm.check_height(height_m := float(self.b0[2]))
        self._height_m = height_m
        self._in_R = instance.translated(-self.b0)
        self._whole: Simulation | None = None
        self._waking: PartlyAsleep | None = None
        if sleep and instance.stems is not None:
            self._waking = StemWakingSimulation(scenario, self._in_R, height_m)
        elif sleep and can_sleep(instance):
            self._waking = WakingSimulation(scenario, self._in_R, height_m, pool)

    def reach(
        self, p_WG: Vector, x0: Vector, keep_states: bool = False, q: Vector | None = None
    ) -> ReachResult:
        """Simulates a reach.

        A redundant arm starts in the first of its configurations for the start pose, in the arm's
        order of preference, in which it touches nothing (paper III-E).

        Args:
            p_WG: Goal, shape (3,), metres.
            x0: Start pose of the hand.
            keep_states: Whether the trace is to hold the whole scene.
            q: Joint angles to begin with, shape (m,), radians; by default the first as above.

        Returns:
            How it ended. A goal out of the arm's reach is known to fail without simulating it.
        """
        p_RG = p_WG - self.b0
        if not is_within_reach(self.scenario, p_RG):
            return ReachResult("unreachable", ReachTrace(), "the goal is beyond the arm's reach")
        angles = self.arm.solve_ik(Start(x0, self.b0).x0_R) if q is None else q[None]
        if not len(angles):
            return ReachResult(
                "invalid_start", ReachTrace(), "no configuration within the joint limits"
            )
        result = self._simulate(angles, p_RG, keep_states)
        result.trace.translate(self.b0, objects_too=self.instance.stems is None)
        return result

    def _simulate(self, angles: Vector, p_RG: Vector, keep_states: bool) -> ReachResult:
        if self._waking is not None:
            # Where something moved too far at once, the reach is repeated with all objects awake.
            with suppress(MovedTooFarError):
                return self._simulate_in(self._waking, angles, p_RG, keep_states)
        return self._simulate_in(self._all_awake(), angles, p_RG, keep_states)

    def _simulate_in(
        self,
        simulation: Simulation | PartlyAsleep,
        angles: Vector,
        p_RG: Vector,
        keep_states: bool,
    ) -> ReachResult:
        q0 = angles[0]
        if len(angles) > 1:
            simulation.begin(q0, p_RG)
            free = simulation.find_free(angles)
            q0 = q0 if free is None else free
        result = simulate(simulation, self.scenario, q0, p_RG, keep_states, self.arm)
        if result.trace.q:
            p_WO = simulation.state().p_WO
            result.trace.p_WO = p_WO if np.all(np.isfinite(p_WO)) else None
        return result

    def _all_awake(self) -> Simulation:
        """Returns the simulation in which nothing sleeps, built when it is first needed."""
        if self._whole is None:
            diagram = make_reach_diagram(self.scenario, self._in_R, height_m=self._height_m)
            self._whole = Simulation(diagram, self.scenario.scene)
        return self._whole


def simulate(
    simulation: Simulation | PartlyAsleep,
    scenario: Scenario,
    q0: Vector,
    p_RG: Vector,
    keep_states: bool = False,
    arm: Arm | None = None,
) -> ReachResult:
    """Runs a simulation from rest at q0 until a stop rule ends it.

    Args:
        simulation: The environment.
        scenario: Gives the control period and the stop rules.
        q0: First joint angles, shape (m,), radians.
        p_RG: Goal, shape (3,), metres.
        keep_states: Whether the trace is to hold the whole scene.
        arm: The arm; by default as the scenario's task has it.

    Raises:
        MovedTooFarError: The simulation must be repeated with every object awake.
    """
    arm = scenario.arm() if arm is None else arm
    period_s = scenario.mpc.period_s
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
        simulation.look_around(q)
        step += 1
