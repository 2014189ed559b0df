"""Measures where the time of a reach goes."""

import time
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario


@dataclass(frozen=True, kw_only=True)
class ReachSpeed:
    """Medians over the reaches of a benchmark.

    Attributes:
        robot: Name of the robot.
        category: Name of the clutter category.
        reaches: Number of reaches timed.
        simulated_s: Simulated time of all of them, seconds.
        wall_per_reach_s: Wall time of a reach, seconds.
        wall_per_sim_s: Wall seconds per simulated second.
        split: Shares of the wall time of all reaches: physics (Drake's stepping), sensor (tactile
            sensor), mpc (controller without the sensor), rest (set-up, stop rules, record).
    """

    robot: str
    category: str
    reaches: int
    simulated_s: float
    wall_per_reach_s: float
    wall_per_sim_s: float
    split: dict[str, float]

    def to_dict(self) -> dict[str, Any]:
        """Returns the figures as a plain dictionary."""
        return asdict(self)


class _Stopwatch:
    """Adds up the time spent in a method, by wrapping it for the length of a with block."""

    def __init__(self, owner: type, name: str) -> None:
        self.seconds = 0.0
        self._owner, self._name = owner, name
        self._method = getattr(owner, name)

    def __enter__(self) -> "_Stopwatch":
        method = self._method

        def timed(*args: Any, **kwargs: Any) -> Any:
            began = time.perf_counter()
            try:
                return method(*args, **kwargs)
            finally:
                self.seconds += time.perf_counter() - began

        setattr(self._owner, self._name, timed)
        return self

    def __exit__(self, *exception: object) -> None:
        setattr(self._owner, self._name, self._method)


def measure_reaches(scenario: Scenario, reaches: int, per_environment: int = 5) -> ReachSpeed:
    """Times reaches from random starts to random goals in one process.

    The first reach of an environment builds its diagram; that time counts, as it does in a
    collection.

    Args:
        scenario: What to simulate.
        reaches: How many reaches to time.
        per_environment: How many of them share an environment.
    """
    starts = scenario.task.start_line.grid(scenario.arm())
    records = []
    rng = np.random.default_rng(0)
    # Diagrams bind the methods when they are built, so the watches go on before the first one.
    with (
        _Stopwatch(TactileSensor, "_calc_taxel_force") as sensor,
        _Stopwatch(HapticMpcController, "_update") as controller,
        _Stopwatch(Simulator, "AdvanceTo") as stepping,
    ):
        began = time.perf_counter()
        for i in range(reaches):
            environment, goal_index = divmod(i, per_environment)
            p_WG = scenario.sample_goal("calibration", environment, goal_index)
            x0 = starts[rng.integers(len(starts))]
            records.append(
                run_reach(
                    ReachRequest(
                        scenario=scenario,
                        stream="calibration",
                        environment=environment,
                        goal=(float(p_WG[0]), float(p_WG[1]), float(p_WG[2])),
                        start=(float(x0[0]), float(x0[1]), float(x0[2])),
                    )
                )
            )
        total = time.perf_counter() - began
    moving = [record for record in records if record.duration_s > 0.0]
    # The stop rules ask for the taxel forces first; the controller finds them in Drake's cache.
    seconds = {
        "physics": stepping.seconds - controller.seconds,
        "sensor": sensor.seconds,
        "mpc": controller.seconds,
        "rest": total - stepping.seconds - sensor.seconds,
    }
    return ReachSpeed(
        robot=scenario.robot,
        category=scenario.category,
        reaches=len(moving),
        simulated_s=sum(record.duration_s for record in moving),
        wall_per_reach_s=median(record.wall_time_s for record in moving),
        wall_per_sim_s=median(record.wall_time_s / record.duration_s for record in moving),
        split={name: value / total for name, value in seconds.items()},
    )
