"""Benchmark of the simulation of reaches, with a breakdown of its time."""

import cProfile
import pstats
import re
import time
from collections import Counter, defaultdict
from pathlib import Path
from statistics import median
from typing import Any

import lic_drake
from lic_drake.errors import RequestError
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach, simulate_request

PARTS = {
    r"reach/.*:advance_to$": "physics",  # It calls Drake's `Simulator.AdvanceTo`.
    r"control/(tactile|taxels)": "sensor",
    r"control/": "mpc",
    r"scene/|reach/(diagram|simulation|sleeping)": "build",
    r"reach/": "rest",
}
"""Part of the time by a pattern of module:function in the package; the first match counts."""

_PACKAGE = Path(lic_drake.__file__).parent.as_posix() + "/"
_ROUNDS = 10  # Maximum call depth below a module of the package.


def measure_reaches(scenario: Scenario, reaches: int, per_environment: int = 5) -> dict[str, Any]:
    """Times reaches from random starts to random goals in one process.

    Returns medians over the reaches, seconds; `split` holds shares of time under Python's profiler,
    which overstates Python's part: physics (Drake's time steps), sensor (contacts and taxels), mpc,
    build (models, diagrams, contexts, waking objects), rest (stop rules, records). `per_sim_s`
    tells what CENIC did, see `lic_drake.reach.rig.Stepper`.
    """
    environments = -(-reaches // per_environment)
    requests = random_requests(scenario, "calibration", environments + 1, per_environment)
    records = [run_reach(request) for request in requests[:reaches]]
    with cProfile.Profile(time.process_time) as profile:
        traces = [simulate_request(request).trace for request in requests[-per_environment:]]
    done = sum((trace.statistics for trace in traces), Counter())
    profiled_s = sum(trace.time_s[-1] for trace in traces if trace.time_s)
    moving = [record for record in records if record.duration_s > 0.0]
    if not moving or not profiled_s:
        raise RequestError("no reach began, so none can be timed; change starts or goals")
    return {
        "robot": scenario.robot,
        "category": scenario.category,
        "reaches": len(moving),
        "simulated_s": sum(record.duration_s for record in moving),
        "wall_per_reach_s": median(record.wall_time_s for record in moving),
        "wall_per_sim_s": median(record.wall_time_s / record.duration_s for record in moving),
        "split": split_time(pstats.Stats(profile)),
        "per_sim_s": {name: count / profiled_s for name, count in sorted(done.items())},
    }


def split_time(stats: pstats.Stats) -> dict[str, float]:
    """Returns the share of each part in a profile; shares add up to 1.

    The time of other functions, such as NumPy's, is divided among the parts that call them.
    """
    functions = stats.stats  # type: ignore[attr-defined]
    parts = {function: _part(function) for function in functions}
    shares = {function: {part: 1.0} for function, part in parts.items() if part}
    for _ in range(_ROUNDS):
        for function, (*_, callers) in functions.items():
            total = sum(called[3] for called in callers.values())
            if parts[function] or not total:
                continue
            mixed: dict[str, float] = defaultdict(float)
            for caller, called in callers.items():
                for part, share in shares.get(caller, {}).items():
                    mixed[part] += share * called[3] / total
            shares[function] = mixed
    seconds = dict.fromkeys(("physics", "sensor", "mpc", "build", "rest"), 0.0)
    for function, (_, _, own, _, _) in functions.items():
        of = shares.get(function, {})
        for part, share in of.items():
            seconds[part] += share * own
        seconds["rest"] += (1.0 - sum(of.values())) * own
    whole = sum(seconds.values())
    return {name: value / whole for name, value in seconds.items()}


def _part(function: tuple[str, int, str]) -> str:
    """Returns the part to which a function belongs, or ""."""
    path = Path(function[0]).as_posix()
    name = f"{path.removeprefix(_PACKAGE)}:{function[2]}"
    matching = (part for pattern, part in PARTS.items() if re.match(pattern, name))
    return next(matching, "") if path.startswith(_PACKAGE) else ""
