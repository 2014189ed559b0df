"""`run_reach`: simulates one request and returns its record."""

import gc
import math
import time
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

import lic_drake
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRecord, ReachRequest, flat_starts
from lic_drake.reach.simulation_pool import SimulationPool
from lic_drake.reach.start import IN_SPACE, POSE_AXES
from lic_drake.reach.trace import ReachResult
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 8
"""Environments, with their bases and histories, whose diagrams a process keeps at a time."""

MAX_ENDS = 10_000
"""Reaches of which a process remembers where they left the objects."""

_pool = SimulationPool()
_environments: dict[tuple[object, ...], Environment] = {}
_ends: dict[str, Vector] = {}


def environment_of(request: ReachRequest, sleep: bool = True) -> Environment:
    """Returns the environment of a request, as the reaches before it left it.

    Diagrams of the last few requests of the same drawn environment are kept in this process.
    """
    drawn = (request.scenario.digest, request.stream, request.environment, sleep)
    key = (*drawn, tuple(request.start.b0.tolist()), request.after)
    if key not in _environments:
        known = next(iter(_environments), drawn)
        if len(_environments) >= MAX_ENVIRONMENTS or known[: len(drawn)] != drawn:
            _environments.clear()
            # Diagrams with Python systems are reference cycles: only the collector frees them.
            gc.collect()
        _environments[key] = Environment(
            request.scenario,
            instance_of(request),
            sleep,
            b0=request.start.b0,
            pool=_pool,
        )
    return _environments[key]


def instance_of(request: ReachRequest) -> ClutterInstance:
    """Returns the clutter that a request finds: as drawn, or as the reaches before it left it.

    Those are simulated unless this process did so not long ago.
    """
    drawn = request.scenario.sample_instance(request.stream, request.environment)
    before = request.before()
    if before is None:
        return drawn
    if before.key not in _ends:
        remember_end(before, simulate_request(before))
    return drawn.with_objects_at(_ends[before.key])


def simulate_request(
    request: ReachRequest, sleep: bool = True, keep_states: bool = False
) -> ReachResult:
    """Simulates a request and returns how it went, sample by sample; see `Environment.reach`."""
    start = request.start
    return environment_of(request, sleep).reach(request.goal, start.x0, keep_states, start.q)


def remember_end(request: ReachRequest, result: ReachResult) -> None:
    """Keeps where a reach left the objects, for requests that come after it."""
    if len(_ends) >= MAX_ENDS:
        _ends.clear()
    p_WO = result.trace.p_WO
    if p_WO is None:  # It never began, or the simulator failed: nothing is known to have moved.
        instance = environment_of(request).instance
        p_WO = instance.p_WO[instance.movable, : instance.num_axes]
    _ends[request.key] = p_WO


def run_reach(request: ReachRequest, sleep: bool = True) -> ReachRecord:
    """Simulates a request; its record depends on nothing else.

    Physical failures are outcomes, not exceptions: see `lic_drake.reach.request.OUTCOMES`.

    Args:
        request: The reach.
        sleep: See `Environment`.
    """
    began = time.perf_counter()
    result = simulate_request(request, sleep)
    if sleep:  # Without, the last digits may differ, and later records would with them.
        remember_end(request, result)
    return make_record(request, result, time.perf_counter() - began)


def make_record(request: ReachRequest, result: ReachResult, wall_time_s: float) -> ReachRecord:
    """Returns the library row of a finished reach."""
    outcome, trace, detail = result
    scenario = request.scenario
    nothing = not trace.q
    x0, b0 = request.start.x0, request.start.b0
    if nothing:
        final = np.full(len(x0), np.nan)
    else:
        final = scenario.arm().tip_pose(trace.q[-1])
    axes = 3 if len(x0) == IN_SPACE else 2
    final[:axes] += b0[:axes]
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
        **dict(zip(("goal_x", "goal_y", "goal_z"), request.goal.tolist(), strict=True)),
        outcome=outcome,
        success=outcome == "reached",
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
        base_x=float(b0[0]),
        base_y=float(b0[1]),
        after=flat_starts(request.after),
        torso=float(b0[2]),
        final_vz=float(velocity[2]) if len(x0) == IN_SPACE else 0.0,
        **_pose_columns("start", x0),
        **_pose_columns("final", final),
    )


def _pose_columns(name: str, x: Vector) -> dict[str, Any]:
    """Returns the columns of a hand pose, (x, y, phi) or position and quaternion."""
    axes = POSE_AXES[len(x)]
    columns = {f"{name}_{axis}": float(value) for axis, value in zip(axes, x, strict=True)}
    return {f"{name}_phi": 0.0} | columns


@cache
def _drake_version() -> str:
    return version("drake")
