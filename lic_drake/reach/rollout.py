"""`run_reach`: simulates one request and returns its record."""

import gc
import math
import time
from functools import cache
from importlib.metadata import version
from typing import cast

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import QueryObject
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

import lic_drake
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.diagram import ReachDiagram, make_reach_diagram
from lic_drake.reach.request import ReachRecord, ReachRequest, is_within_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.stop_rules import StopMonitor
from lic_drake.reach.trace import ReachResult, ReachTrace
from lic_drake.scene.culling import reaches_left_out, select_near, take

Vector = NDArray[np.float64]


class Environment:
    """One environment of a scenario with its diagram, used for many reaches."""

    def __init__(self, scenario: Scenario, instance: ClutterInstance) -> None:
        self.scenario = scenario
        self.instance = instance
        self.arm = scenario.arm()
        self.keep = select_near(instance, self.arm.reach_m)
        self._near = make_reach_diagram(scenario, take(instance, self.keep))
        self._whole: ReachDiagram | None = None

    def reach(self, p_WG: Vector, x0: Vector) -> ReachResult:
        """Simulates a reach.

        Args:
            p_WG: Goal, shape (3,), metres.
            x0: Start pose of the hand.

        Returns:
            How it ended. A goal out of the arm's reach is known to fail without simulating it.
        """
        if not is_within_reach(self.scenario, p_WG):
            return ReachResult("unreachable", ReachTrace(), "the goal is beyond the arm's reach")
        result = self._run(self._near, p_WG, x0)
        if reaches_left_out(self.instance, self.keep, result.trace.outermost_m):
            if self._whole is None:
                self._whole = make_reach_diagram(self.scenario, self.instance)
            result = self._run(self._whole, p_WG, x0)
        return result

    def _run(self, reach_diagram: ReachDiagram, p_WG: Vector, x0: Vector) -> ReachResult:
        q0 = self.arm.solve_ik(x0)
        if q0 is None:
            return ReachResult(
                "invalid_start", ReachTrace(), "no configuration within the joint limits"
            )
        return simulate(reach_diagram, self.scenario, q0, p_WG)


def simulate(
    reach_diagram: ReachDiagram,
    scenario: Scenario,
    q0: Vector,
    p_WG: Vector,
    begin_s: float = 0.0,
) -> ReachResult:
    """Runs a diagram from rest at q0 until a stop rule ends the reach.

    Args:
        reach_diagram: The environment's diagram.
        scenario: Gives the control period and the stop rules.
        q0: First joint angles, shape (m,), radians.
        p_WG: Goal, shape (3,), metres.
        begin_s: Time on the diagram's clock at which the reach begins, a whole number of seconds;
            the trace's times count from there. Recordings put one reach after another with it.
    """
    diagram, scene = reach_diagram.diagram, reach_diagram.scene
    arm = scenario.arm()
    period_s = scenario.mpc.period_s
    # Drake's own arithmetic for periodic events: no rounding error decides whether a sample comes
    # before or after the events of its instant.
    first = round(begin_s / period_s)
    context = reach_diagram.make_context(q0, p_WG)
    context.SetTime(first * period_s)
    query = cast(
        QueryObject,
        scene.scene_graph.get_query_output_port().Eval(
            scene.scene_graph.GetMyContextFromRoot(context)
        ),
    )
    if query.HasCollisions():
        return ReachResult(
            "invalid_start", ReachTrace(), "the arm touches the clutter at its start"
        )

    arm_state = diagram.GetOutputPort("arm_state")
    clutter_state = diagram.GetOutputPort("clutter_state")
    taxel_force = diagram.GetOutputPort("taxel_force")
    num_movable = scene.plant.num_positions(scene.clutter) // 2
    monitor = StopMonitor(scenario.stop, p_WG, period_s)
    trace = ReachTrace()
    simulator = Simulator(diagram, context)
    if scenario.scene.time_step_s == 0.0:
        simulator_config = SimulatorConfig(
            integration_scheme="cenic",
            accuracy=scenario.scene.cenic_accuracy,
            max_step_size=scenario.scene.cenic_max_step_s,
            start_time=first * period_s,
        )
        ApplySimulatorConfig(simulator_config, simulator)
    step = 0
    while True:
        try:
            if step == 0:
                simulator.Initialize()
            simulator.AdvanceTo((first + step) * period_s)
            q = np.array(arm_state.Eval(context))[: len(q0)]
            # Reading the taxels solves the contacts of this instant, which can fail, too.
            forces = np.asarray(taxel_force.Eval(context))
        except (ArithmeticError, RuntimeError, ValueError) as error:
            return ReachResult("diverged", trace, " ".join(str(error).split())[:200])
        if not np.all(np.isfinite(q)):
            return ReachResult("diverged", trace, "joint angles are not finite")
        p_WE = arm.tip_position(q)
        time_s = step * period_s
        trace.append(time_s, q, p_WE, forces)
        if num_movable:
            trace.follow(np.asarray(clutter_state.Eval(context))[: 2 * num_movable])
        outcome = monitor.update(time_s, p_WE, trace.peak_force[-1])
        if outcome is not None:
            return ReachResult(outcome, trace)
        step += 1


_recent: dict[tuple[str, str, int], Environment] = {}


def environment_of(request: ReachRequest) -> Environment:
    """Returns the environment of a request; the last one used in this process is kept."""
    key = (request.scenario.digest, request.stream, request.environment)
    if key not in _recent:
        _recent.clear()
        # Diagrams with Python systems are reference cycles: only the collector frees them.
        gc.collect()
        scenario = request.scenario
        instance = scenario.sample_instance(request.stream, request.environment)
        _recent[key] = Environment(scenario, instance)
    return _recent[key]


def run_reach(request: ReachRequest) -> ReachRecord:
    """Simulates a request; its record depends on nothing else.

    Physical failures are outcomes, not exceptions: see `lic_drake.reach.request.OUTCOMES`.
    """
    began = time.perf_counter()
    p_WG, x0 = np.array(request.goal), np.array(request.start)
    result = environment_of(request).reach(p_WG, x0)
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
