"""`make_record`: the library row of a finished reach."""

import math
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

import lic_drake
from lic_drake.reach.request import ReachRecord, ReachRequest, flat_starts
from lic_drake.reach.start import IN_SPACE, POSE_AXES
from lic_drake.reach.trace import ReachResult
from lic_drake.types import Vector


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
    # Kept where the reach never began, too: with the key they lead back to the request.
    prescribed = np.zeros(0) if request.start.q is None else request.start.q
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
        q_start=tuple((trace.q[0] if trace.q else prescribed).tolist()),
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
