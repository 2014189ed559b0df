"""Measures where the time of a reach goes."""

import time
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any, ClassVar

from pydrake.systems.analysis import Simulator

from lic_drake.control.mpc_controller import HapticMpcController
from lic_drake.control.tactile_sensor import TactileSensor
from lic_drake.evaluate.batch import random_requests
from lic_drake.reach.environment import Environment
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.stem_waking import StemWakingSimulation
from lic_drake.reach.waking import WakingSimulation


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
        split: Shares of the wall time of all reaches: physics (Drake's steps, and the contacts at
            the control instants), sensor (taxels from contacts), mpc (controller without the
            sensor), build (diagrams and their contexts), rest (stop rules, waking, records).
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


class Stopwatch:
    """Adds up the time spent in a method, by wrapping it for the length of a with block.

    Time in another watched method that it calls is that one's.
    """

    _running: ClassVar[list["Stopwatch"]] = []

    def __init__(self, owner: type, name: str) -> None:
        self.seconds = 0.0
        self._owner, self._name = owner, name
        self._method = getattr(owner, name)

    def __enter__(self) -> "Stopwatch":
        method = self._method

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._running.append(self)
            began = time.perf_counter()
            try:
                return method(*args, **kwargs)
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


def measure_reaches(scenario: Scenario, reaches: int, per_environment: int = 5) -> ReachSpeed:
    """Times reaches from random starts to random goals in one process.

    The first reach of an environment builds its diagram; that time counts, as it does in a
    collection.

    Args:
        scenario: What to simulate.
        reaches: How many reaches to time.
        per_environment: How many of them share an environment.
    """
    environments = -(-reaches // per_environment)
    requests = random_requests(scenario, "calibration", environments, per_environment)[:reaches]
    # Diagrams bind the methods when they are built, so the watches go on before the first one.
    with (
        Stopwatch(TactileSensor, "_calc_taxel_force") as sensor,
        Stopwatch(TactileSensor, "_eval_contacts") as contacts,
        Stopwatch(HapticMpcController, "_update") as controller,
        Stopwatch(Simulator, "AdvanceTo") as stepping,
        Stopwatch(WakingSimulation, "_with_spares") as build,
        Stopwatch(StemWakingSimulation, "_with_awake") as build_stems,
        Stopwatch(Environment, "_all_awake") as build_awake,
    ):
        began = time.perf_counter()
        records = [run_reach(request) for request in requests]
        total = time.perf_counter() - began
    moving = [record for record in records if record.duration_s > 0.0]
    seconds = {
        "physics": stepping.seconds + contacts.seconds,
        "sensor": sensor.seconds,
        "mpc": controller.seconds,
        "build": build.seconds + build_stems.seconds + build_awake.seconds,
    }
    seconds["rest"] = total - sum(seconds.values())
    return ReachSpeed(
        robot=scenario.robot,
        category=scenario.category,
        reaches=len(moving),
        simulated_s=sum(record.duration_s for record in moving),
        wall_per_reach_s=median(record.wall_time_s for record in moving),
        wall_per_sim_s=median(record.wall_time_s / record.duration_s for record in moving),
        split={name: value / total for name, value in seconds.items()},
    )
