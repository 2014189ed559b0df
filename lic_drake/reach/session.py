"""`ReachSession`: simulates requests, and owns the diagrams that make the next one quick."""

import gc
import math
import time
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np

import lic_drake
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import MAX_DIAGRAMS, Environment
from lic_drake.reach.request import ReachRecord, ReachRequest, flat_starts
from lic_drake.reach.rig import Rig
from lic_drake.reach.simulation import Cache
from lic_drake.reach.start import IN_SPACE, POSE_AXES
from lic_drake.reach.trace import ReachResult
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 8
"""Number of environments, with their bases and histories, that are kept."""

MAX_ENDS = 10_000
"""Number of reaches of which it is remembered where they left the objects."""


_DRAKE_VERSION = version("drake")


class ReachSession:
    """Simulates requests one after another; a result depends on its request alone.

    With `sleep` untouched objects sleep (`lic_drake.reach.sleeping`).
    """

    def __init__(self, sleep: bool = True) -> None:
        self.sleep = sleep
        self.diagrams: Cache[Rig] = Cache(MAX_DIAGRAMS, cyclic=True)
        self.environments: Cache[Environment] = Cache(MAX_ENVIRONMENTS)
        # Positions of the movable objects at the end of reaches, by the request's key.
        self.ends: Cache[Vector] = Cache(MAX_ENDS)

    def run(self, request: ReachRequest) -> ReachRecord:
        """Simulates a request and returns its record.

        Physical failures are outcomes, not exceptions: see `lic_drake.reach.request.OUTCOMES`.
        """
        began = time.perf_counter()
        result = self.simulate(request)
        self.ends.obtain(request.key, lambda: self._end(request, result))
        return make_record(request, result, time.perf_counter() - began)

    def simulate(self, request: ReachRequest, keep_states: bool = False) -> ReachResult:
        """Simulates a request and returns how it went, sample by sample."""
        start = request.start
        return self.environment(request).reach(request.goal, start.x0, keep_states, start.q)

    def environment(self, request: ReachRequest) -> Environment:
        """Returns the environment of a request, as the reaches before it left it."""
        scenario, b0 = request.scenario, request.start.b0

        def build() -> Environment:
            return Environment(scenario, self.instance(request), self.sleep, b0, self.diagrams)

        drawn = (scenario.digest, request.stream, request.environment)
        return self.environments.obtain((*drawn, tuple(b0.tolist()), request.after), build)

    def instance(self, request: ReachRequest) -> ClutterInstance:
        """Returns the clutter that a request finds: as drawn, or as the reaches before it left it.

        Those are simulated unless that was done not long ago.
        """
        drawn = request.scenario.sample_instance(request.stream, request.environment)
        before = request.before()
        if before is None:
            return drawn
        end = self.ends.obtain(before.key, lambda: self._end(before, self.simulate(before)))
        return drawn.with_objects_at(end)

    def clear(self) -> None:
        """Forgets everything."""
        for kept in (self.environments, self.diagrams, self.ends):
            kept.clear()
        gc.collect()

    def _end(self, request: ReachRequest, result: ReachResult) -> Vector:
        """Returns where a reach left the movable objects: where they were if it never began."""
        if result.trace.q_clutter is not None:
            return result.trace.q_clutter
        instance = self.environment(request).instance
        return np.array(instance.p_WO[instance.movable, : instance.num_axes])


@cache
def default_session(sleep: bool) -> ReachSession:
    """Returns the session of this process, one with sleeping objects and one without."""
    return ReachSession(sleep)


def run_reach(request: ReachRequest, sleep: bool = True) -> ReachRecord:
    """Simulates a request in this process's session; see `ReachSession.run`."""
    return default_session(sleep).run(request)


def simulate_request(request: ReachRequest, keep_states: bool = False) -> ReachResult:
    """Simulates a request in this process's session; see `ReachSession.simulate`."""
    return default_session(True).simulate(request, keep_states)


def instance_of(request: ReachRequest) -> ClutterInstance:
    """Returns the clutter that a request finds; see `ReachSession.instance`."""
    return default_session(True).instance(request)


def make_record(request: ReachRequest, result: ReachResult, wall_time_s: float) -> ReachRecord:
    """Returns the library row of a finished reach."""
    outcome, trace, detail = result
    scenario, x0, b0 = request.scenario, request.start.x0, request.start.b0
    # Kept where the reach never began, too: with the key they lead back to the request.
    q_start = np.zeros(0) if request.start.q is None else request.start.q
    final, velocity = np.full(len(x0), np.nan), np.full(3, np.nan)
    if trace.q:
        q_start = trace.q[0]
        final = scenario.arm().tip_pose(trace.q[-1])
        velocity = trace.final_velocity(scenario.stop.stuck_time_s if outcome == "stuck" else 0.0)
    in_space = len(x0) == IN_SPACE
    axes = 3 if in_space else 2
    final[:axes] += b0[:axes]
    distances = np.linalg.norm(np.array(trace.p_WE).reshape(-1, 3) - request.goal, axis=1)
    poses: dict[str, Any] = {
        f"{name}_{axis}": float(value)
        for name, pose in (("start", x0), ("final", final))
        for axis, value in zip(POSE_AXES[len(x0)], pose, strict=True)
    }
    return ReachRecord(
        key=request.key,
        category=scenario.category,
        robot=scenario.arm().name,
        scenario=scenario.digest,
        stream=request.stream,
        environment=request.environment,
        **dict(zip(("goal_x", "goal_y", "goal_z"), request.goal.tolist(), strict=True)),
        outcome=outcome,
        success=outcome == "reached",
        final_vx=float(velocity[0]),
        final_vy=float(velocity[1]),
        min_distance=float(distances.min()) if trace.q else math.nan,
        peak_force=max(trace.peak_force, default=math.nan),
        mean_force=trace.mean_force if trace.q else math.nan,
        peak_contacts=max(trace.contacts, default=0),
        mean_contacts=float(np.mean(trace.contacts)) if trace.q else math.nan,
        duration_s=trace.time_s[-1] if trace.q else 0.0,
        wall_time_s=wall_time_s,
        q_start=tuple(q_start.tolist()),
        q_final=tuple(trace.q[-1].tolist()) if trace.q else (),
        detail=detail,
        lic_drake_version=lic_drake.__version__,
        drake_version=_DRAKE_VERSION,
        base_x=float(b0[0]),
        base_y=float(b0[1]),
        after=flat_starts(request.after),
        torso=float(b0[2]),
        final_vz=float(velocity[2]) if in_space else 0.0,
        **{"start_phi": 0.0, "final_phi": 0.0} | poses,
    )
