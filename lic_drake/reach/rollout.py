"""`run_reach`: simulates one request and returns its record."""

import gc
import math
import time
from contextlib import suppress
from functools import cache
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

import lic_drake
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import make_reach_diagram
from lic_drake.reach.request import ReachRecord, ReachRequest, is_within_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.simulation import Simulation
from lic_drake.reach.stop_rules import StopMonitor
from lic_drake.reach.trace import ReachResult, ReachTrace
from lic_drake.reach.waking import WakingSimulation
from lic_drake.scene.sleep import MovedTooFarError, can_sleep

Vector = NDArray[np.float64]


class Environment:
    """One environment of a scenario with its diagrams, used for many reaches.

    Args:
        scenario: Robot, contact, controller, stop rules.
        instance: The clutter.
        sleep: Whether objects may sleep until the arm comes near; without, a reach costs three
            times as much and ends the same.
    """

    def __init__(self, scenario: Scenario, instance: ClutterInstance, sleep: bool = True) -> None:
        self.scenario = scenario
        self.instance = instance
        self.arm = scenario.arm()
        self._whole: Simulation | None = None
        self._waking: WakingSimulation | None = None
        if sleep and can_sleep(instance):
            self._waking = WakingSimulation(scenario, instance)

    def reach(self, p_WG: Vector, x0: Vector, keep_states: bool = False) -> ReachResult:
        """Simulates a reach.

        Args:
            p_WG: Goal, shape (3,), metres.
            x0: Start pose of the hand.
            keep_states: Whether the trace is to hold the whole scene.

        Returns:
            How it ended. A goal out of the arm's reach is known to fail without simulating it.
        """
        if not is_within_reach(self.scenario, p_WG):
            return ReachResult("unreachable", ReachTrace(), "the goal is beyond the arm's reach")
        q0 = self.arm.solve_ik(x0)
        if q0 is None:
            return ReachResult(
                "invalid_start", ReachTrace(), "no configuration within the joint limits"
            )
        if self._waking is not None:
            # Where something moved too far at once, the reach is repeated with all objects awake.
            with suppress(MovedTooFarError):
                return simulate(self._waking, self.scenario, q0, p_WG, keep_states)
        return simulate(self._all_awake(), self.scenario, q0, p_WG, keep_states)

    def _all_awake(self) -> Simulation:
        """Returns the simulation in which nothing sleeps, built when it is first needed."""
        if self._whole is None:
            diagram = make_reach_diagram(self.scenario, self.instance)
            self._whole = Simulation(diagram, self.scenario.scene)
        return self._whole


def simulate(
    simulation: Simulation | WakingSimulation,
    scenario: Scenario,
    q0: Vector,
    p_WG: Vector,
    keep_states: bool = False,
) -> ReachResult:
    """Runs a simulation from rest at q0 until a stop rule ends the reach.

    Args:
        simulation: The environment.
        scenario: Gives the control period and the stop rules.
        q0: First joint angles, shape (m,), radians.
        p_WG: Goal, shape (3,), metres.
        keep_states: Whether the trace is to hold the whole scene.

    Raises:
        MovedTooFarError: The simulation must be repeated with every object awake.
    """
    arm = scenario.arm()
    period_s = scenario.mpc.period_s
    simulation.begin(q0, p_WG)
    if simulation.is_in_collision():
        return ReachResult(
            "invalid_start", ReachTrace(), "the arm touches the clutter at its start"
        )
    monitor = StopMonitor(scenario.stop, p_WG, period_s)
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
        p_WE = arm.tip_position(q)
        trace.append(time_s, q, p_WE, forces)
        if keep_states:
            trace.states.append(simulation.state())
        outcome = monitor.update(time_s, p_WE, trace.peak_force[-1])
        if outcome is not None:
            return ReachResult(outcome, trace)
        simulation.look_around(q)
        step += 1


_recent: dict[tuple[str, str, int, bool], Environment] = {}


def environment_of(request: ReachRequest, sleep: bool = True) -> Environment:
    """Returns the environment of a request; the last one used in this process is kept."""
    key = (request.scenario.digest, request.stream, request.environment, sleep)
    if key not in _recent:
        _recent.clear()
        # Diagrams with Python systems are reference cycles: only the collector frees them.
        gc.collect()
        scenario = request.scenario
        instance = scenario.sample_instance(request.stream, request.environment)
        _recent[key] = Environment(scenario, instance, sleep)
    return _recent[key]


def run_reach(request: ReachRequest, sleep: bool = True) -> ReachRecord:
    """Simulates a request; its record depends on nothing else.

    Physical failures are outcomes, not exceptions: see `lic_drake.reach.request.OUTCOMES`.

    Args:
        request: The reach.
        sleep: See `Environment`.
    """
    began = time.perf_counter()
    p_WG, x0 = np.array(request.goal), np.array(request.start)
    result = environment_of(request, sleep).reach(p_WG, x0)
    return make_record(request, result, time.perf_counter() - began)


def make_record(request: ReachRequest, result: ReachResult, wall_time_s: float) -> ReachRecord:
    """Returns the library row of a finished reach."""
    outcome, trace, detail = result
    scenario = request.scenario
    nothing = not trace.q
    final = np.full(3, np.nan) if nothing else scenario.arm().tip_pose(trace.q[-1])
    still_s = scenario.stop.stuck_time_s if outcome == "stuck" else 0.0
    velocity = np.full(3, np.nan) if nothing else trace.final_velocity(still_s)
    distances = np.linalg.norm(np.array(trace.p_WE).reshape(-1, 3) - request.goal, axis=1)
    return ReachRecord(
        key=request.key,
        category=scenario.category,
        robot=scenario.robot,
        scenario=scenario.digest,
        stream=request.stream,
        environment=request.environment,
        goal_x=request.goal[0],
        goal_y=request.goal[1],
        goal_z=request.goal[2],
        start_x=request.start[0],
        start_y=request.start[1],
        start_phi=request.start[2],
        outcome=outcome,
        success=outcome == "reached",
        final_x=float(final[0]),
        final_y=float(final[1]),
        final_phi=float(final[2]),
        final_vx=float(velocity[0]),
        final_vy=float(velocity[1]),
        min_distance=math.nan if nothing else float(distances.min()),
        peak_force=math.nan if nothing else max(trace.peak_force),
        mean_force=math.nan if nothing else trace.mean_force,
        peak_contacts=0 if nothing else max(trace.contacts),
        mean_contacts=math.nan if nothing else float(np.mean(trace.contacts)),
        duration_s=0.0 if nothing else trace.time_s[-1],
        wall_time_s=wall_time_s,
        q_start=() if nothing else tuple(trace.q[0].tolist()),
        q_final=() if nothing else tuple(trace.q[-1].tolist()),
        detail=detail,
        lic_drake_version=lic_drake.__version__,
        drake_version=_drake_version(),
    )


@cache
def _drake_version() -> str:
    return version("drake")
