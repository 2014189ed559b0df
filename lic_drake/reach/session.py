"""`ReachSession`: simulates requests, and owns the diagrams that make the next one quick."""

import time
from functools import cache

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.reach.environment import MAX_DIAGRAMS, Environment
from lic_drake.reach.record import make_record
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.simulation import Cache, Simulation
from lic_drake.reach.trace import ReachResult
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 8
"""Number of environments, with their bases and histories, that are kept."""

MAX_ENDS = 10_000
"""Number of reaches of which it is remembered where they left the objects."""


class ReachSession:
    """Simulates requests one after another; a result depends on its request alone.

    Args:
        sleep: Whether untouched objects sleep (`lic_drake.reach.sleeping`).

    Attributes:
        diagrams: The diagrams that are kept.
        environments: The environments that are kept.
        ends: Positions of the movable objects at the end of reaches, by the request's key.
    """

    def __init__(self, sleep: bool = True) -> None:
        self.sleep = sleep
        self.diagrams: Cache[Simulation] = Cache(MAX_DIAGRAMS)
        self.environments: Cache[Environment] = Cache(MAX_ENVIRONMENTS)
        self.ends: Cache[Vector] = Cache(MAX_ENDS)

    def run(self, request: ReachRequest) -> ReachRecord:
        """Simulates a request and returns its record.

        Physical failures are outcomes, not exceptions: see `lic_drake.reach.request.OUTCOMES`.
        """
        began = time.perf_counter()
        result = self.simulate(request)
        self._remember_end(request, result)
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
        return self.environments.get((*drawn, tuple(b0.tolist()), request.after), build)

    def instance(self, request: ReachRequest) -> ClutterInstance:
        """Returns the clutter that a request finds: as drawn, or as the reaches before it left it.

        Those are simulated unless that was done not long ago.
        """
        drawn = request.scenario.sample_instance(request.stream, request.environment)
        before = request.before()
        if before is None:
            return drawn
        return drawn.with_objects_at(self.ends.get(before.key, lambda: self._end(before)))

    def clear(self) -> None:
        """Forgets everything."""
        for kept in (self.environments, self.diagrams, self.ends):
            kept.clear()

    def _remember_end(self, request: ReachRequest, result: ReachResult) -> None:
        self.ends.get(request.key, lambda: self._positions(request, result))

    def _end(self, request: ReachRequest) -> Vector:
        return self._positions(request, self.simulate(request))

    def _positions(self, request: ReachRequest, result: ReachResult) -> Vector:
        """Returns where a reach left the movable objects: where they were if it never began."""
        if result.trace.p_WO is not None:
            return result.trace.p_WO
        instance = self.environment(request).instance
        return np.array(instance.p_WO[instance.movable, : instance.num_axes])


@cache
def default_session(sleep: bool) -> ReachSession:
    """Returns the session of this process, one with sleeping objects and one without."""
    return ReachSession(sleep)


def run_reach(request: ReachRequest, sleep: bool = True) -> ReachRecord:
    """Simulates a request in this process's session; see `ReachSession.run`.

    Args:
        request: The reach.
        sleep: See `ReachSession`.
    """
    return default_session(sleep).run(request)


def simulate_request(request: ReachRequest, keep_states: bool = False) -> ReachResult:
    """Simulates a request in this process's session; see `ReachSession.simulate`."""
    return default_session(True).simulate(request, keep_states)


def instance_of(request: ReachRequest) -> ClutterInstance:
    """Returns the clutter that a request finds; see `ReachSession.instance`."""
    return default_session(True).instance(request)
