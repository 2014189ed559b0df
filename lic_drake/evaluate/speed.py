"""Benchmark of the simulation of reaches, with a breakdown of its time."""

import cProfile
import pstats
import time
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import lic_drake
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach

PARTS = {
    "control/tactile": "sensor",
    "control/taxels": "sensor",
    "control/": "mpc",
    "scene/": "build",
    "reach/diagram": "build",
    "reach/simulation": "build",
    "reach/sleeping": "build",
    "reach/": "rest",
}
"""Part of the time by prefix of a module's path in the package; the first match counts."""

STEP = "advance_to"
"""The method of `lic_drake.reach` that calls Drake's `Simulator.AdvanceTo`, to which the profiler
attributes Drake's own time."""

_PACKAGE = Path(lic_drake.__file__).parent.as_posix() + "/"
_ROUNDS = 10  # Maximum call depth below a module of the package.

_Function = tuple[str, int, str]


@dataclass(frozen=True, kw_only=True)
class ReachSpeed:
    """Medians over the reaches of a benchmark.

    Attributes:
        robot: Name of the robot.
        category: Name of the clutter category.
        reaches: Number of reaches timed.
        simulated_s: Their total simulated time, seconds.
        wall_per_reach_s: Wall time of a reach, seconds.
        wall_per_sim_s: Wall seconds per simulated second.
        split: Shares of time under Python's profiler, which overstates Python's part: physics
            (Drake's time steps), sensor (contacts and taxels), mpc, build (models, diagrams,
            contexts, waking objects), rest (stop rules, records).
    """

    robot: str
    category: str
    reaches: int
    simulated_s: float
    wall_per_reach_s: float
    wall_per_sim_s: float
    split: dict[str, float]


def measure_reaches(scenario: Scenario, reaches: int, per_environment: int = 5) -> ReachSpeed:
    """Times reaches from random starts to random goals in one process.

    The time to build an environment's diagram counts towards its first reach.

    Args:
        scenario: The scenario.
        reaches: Number of reaches to time.
        per_environment: Number of reaches in each environment.
    """
    environments = -(-reaches // per_environment)
    requests = random_requests(scenario, "calibration", environments + 1, per_environment)
    records = [run_reach(request) for request in requests[:reaches]]
    profile = cProfile.Profile(time.process_time)
    profile.enable()
    for request in requests[-per_environment:]:
        run_reach(request)
    profile.disable()
    moving = [record for record in records if record.duration_s > 0.0]
    return ReachSpeed(
        robot=scenario.robot,
        category=scenario.category,
        reaches=len(moving),
        simulated_s=sum(record.duration_s for record in moving),
        wall_per_reach_s=median(record.wall_time_s for record in moving),
        wall_per_sim_s=median(record.wall_time_s / record.duration_s for record in moving),
        split=split_time(pstats.Stats(profile)),
    )


def split_time(stats: pstats.Stats) -> dict[str, float]:
    """Returns the share of each part in a profile; shares add up to 1.

    The time of other functions, such as NumPy's, is divided among the parts that call them.
    """
    functions: Mapping[_Function, Any] = stats.stats  # type: ignore[attr-defined]
    shares: dict[_Function, dict[str, float]] = {f: {_part(f): 1.0} for f in functions if _part(f)}
    other = {f: callers for f, (*_, callers) in functions.items() if f not in shares}
    for _ in range(_ROUNDS):
        for function, callers in other.items():
            total = sum(called[3] for called in callers.values())
            mixed: dict[str, float] = defaultdict(float)
            for caller, called in callers.items():
                for part, share in shares.get(caller, {}).items():
                    mixed[part] += share * called[3] / total if total else 0.0
            shares[function] = mixed
    seconds = dict.fromkeys(("physics", "sensor", "mpc", "build", "rest"), 0.0)
    for function, (_, _, own, _, _) in functions.items():
        of = shares[function]
        for part, share in of.items():
            seconds[part] += share * own
        seconds["rest"] += (1.0 - sum(of.values())) * own
    whole = sum(seconds.values())
    return {name: value / whole for name, value in seconds.items()}


def _part(function: _Function) -> str:
    """Returns the part to which a function belongs, or ""."""
    file, _, name = function
    path = Path(file).as_posix()
    if not path.startswith(_PACKAGE):
        return ""
    module = path.removeprefix(_PACKAGE)
    if name == STEP and module.startswith("reach/"):
        return "physics"
    return next((part for start, part in PARTS.items() if module.startswith(start)), "")
