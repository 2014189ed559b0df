"""Paired reaches: every request in every engine, one engine after the other, part by part."""

import gc
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import groupby
from typing import Any, ClassVar

import numpy as np
from pydrake.systems.analysis import Simulator

from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachResult
from lic_drake.types import Vector
from scripts.mujoco.engines import Engine
from scripts.mujoco.mujoco_simulation import MujocoSimulation

PARTS = ("stepping", "sensor", "mpc")
"""The engine's steps; contact forces at the control instants and taxels; the controller."""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """One reach in one engine; seconds are those of the chosen clock.

    Attributes:
        engine: Name of the engine.
        reach: Number of the request.
        outcome: How the reach ended.
        simulated_s: Simulated time.
        total_s: The reach without building its environment.
        parts: Seconds of total_s in each of `PARTS`; the rest are stop rules and trace.
        setup_s: For the first reach of an environment what that took besides, else None.
    """

    engine: str
    reach: int
    outcome: str
    simulated_s: float
    total_s: float
    parts: dict[str, float]
    setup_s: float | None


def time_paired(
    scenario: Scenario,
    requests: Sequence[ReachRequest],
    engines: Sequence[Engine],
    clock: Callable[[], float],
    say: Callable[[str], None],
) -> list[Timing]:
    """Simulates every request in every engine.

    The first request of an environment is simulated once more before all others: Drake builds
    what it needs when it needs it.

    Args:
        scenario: What to simulate.
        requests: Starts and goals within reach, those of an environment together.
        engines: In the order in which they take turns.
        clock: Seconds of wall or of processor time.
        say: Gets a line after each environment.
    """
    rows: list[Timing] = []
    with _Watches() as watches:  # Drake's diagrams bind methods when they are built.
        for environment, group in groupby(requests, key=lambda r: (r.stream, r.environment)):
            gc.collect()  # Diagrams with Python systems are reference cycles.
            instance = scenario.sample_instance(*environment)
            batch, reach_of, first_s = list(group), {}, {}
            for engine in engines:
                began = clock()
                reach_of[engine] = engine.prepare(scenario, instance)
                reach_of[engine](batch[0])
                first_s[engine] = clock() - began
            for request in batch:
                for engine in engines:
                    before, began, began_wall = watches.read(), clock(), time.perf_counter()
                    result = reach_of[engine](request)
                    total_s = clock() - began
                    # The watches show wall time; the parts of another clock are its shares.
                    share = total_s / (time.perf_counter() - began_wall)
                    parts = share * (watches.read() - before)
                    setup_s = first_s[engine] - total_s if request is batch[0] else None
                    number = len(rows) // len(engines)
                    rows.append(_make_row(engine, number, result, total_s, parts, setup_s))
            say(f"  {len(rows) // len(engines)}/{len(requests)} reaches, {len(engines)} engines")
    return rows


class Stopwatch:
    """Adds up the time spent in a method, by wrapping it for the length of a with block.

    Time in another watched method that it calls is that one's. Diagrams bind methods when they are
    built, so the watches go on before.
    """

    _running: ClassVar[list["Stopwatch"]] = []

    def __init__(self, owner: type, name: str) -> None:
        self.seconds = 0.0
        self._owner, self._name = owner, name
        self._method = getattr(owner, name)

    def __enter__(self) -> "Stopwatch":
        def timed(*args: Any, **kwargs: Any) -> Any:
            self._running.append(self)
            began = time.perf_counter()
            try:
                return self._method(*args, **kwargs)
            finally:
                elapsed = time.perf_counter() - began
                self._running.pop()
                self.seconds += elapsed
                if self._running:
                    self._running[-1].seconds -= elapsed

        setattr(self._owner, self._name, timed)
        return self

    def __exit__(self, *exception: object) -> None:
        setattr(self._owner, self._name, self._method)


class _Watches:
    """Stopwatches over the parts of a reach, of whichever engine is running."""

    def __init__(self) -> None:
        self._drake = Stopwatch(Simulator, "AdvanceTo")
        self._mujoco = Stopwatch(MujocoSimulation, "step")
        self._taxels = Stopwatch(TactileSensor, "_calc_taxel_force")
        self._sense = Stopwatch(MujocoSimulation, "sense")
        self._mpc = Stopwatch(HapticMpcController, "_update")
        self._stack = ExitStack()

    def __enter__(self) -> "_Watches":
        for watch in (self._drake, self._mujoco, self._taxels, self._sense, self._mpc):
            self._stack.enter_context(watch)
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def read(self) -> Vector:
        """Returns the wall seconds in each of `PARTS` so far."""
        sensor = self._taxels.seconds + self._sense.seconds
        stepping = self._drake.seconds + self._mujoco.seconds
        return np.array([stepping, sensor, self._mpc.seconds])


def _make_row(
    engine: Engine,
    number: int,
    result: ReachResult,
    total_s: float,
    parts: Vector,
    setup_s: float | None,
) -> Timing:
    stepping, sensor, mpc = parts.tolist()
    return Timing(
        engine=engine.name,
        reach=number,
        outcome=result.outcome,
        simulated_s=result.trace.time_s[-1] if result.trace.time_s else 0.0,
        total_s=total_s,
        parts={"stepping": stepping, "sensor": sensor, "mpc": mpc},
        setup_s=setup_s,
    )
