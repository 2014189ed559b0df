"""Real second attempts after failures of LIC-1, for LIC-2 to learn from (paper III-C)."""

from collections.abc import Callable, Sequence

import numpy as np

from lic_drake.evaluate.batch import simulate_requests
from lic_drake.experience.added import added_columns
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.starts import make_starts
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import Situation


def collect_second_attempts(
    experience: ExperienceLibrary,
    output: ExperienceLibrary,
    environments: Sequence[int],
    method: str = "gp1",
    workers: int = 1,
    say: Callable[[str], None] = print,
) -> int:
    """Reaches for every goal of some training environments, and again where that failed.

    The first attempt is the strategy's; after a failure, a second one is made from every discrete
    start in the environment as the first one left it.

    Args:
        experience: What the strategy learns from; gives the scenario.
        output: Library for first and second attempts.
        environments: Indices of training environments, better none that `experience` holds.
        method: Strategy of the first attempts.
        workers: Number of processes.
        say: Gets a line now and then.

    Returns:
        Number of second attempts in the library.
    """
    scenario = experience.scenario()
    selector = make_selector(
        method,
        scenario.arm(),
        experience.columns(),
        category=scenario.category,
        added=added_columns(experience),
    )
    firsts: list[ReachRequest] = []
    for environment in environments:
        starts = make_starts(scenario, scenario.sample_instance("training", environment))
        for p_WG in scenario.goals("training", environment):
            chosen = selector.select(Situation(p_WG=p_WG, starts=starts))
            firsts.append(ReachRequest(scenario, "training", environment, p_WG, chosen.start))
    output.create()
    say(f"{len(firsts)} first attempts chosen")
    records = simulate_requests(firsts, output, scenario, workers, say)
    seconds: list[ReachRequest] = []
    for first in firsts:
        record = records[first.key]
        if record.success or not np.isfinite(record.final_x):
            continue
        instance = scenario.sample_instance("training", first.environment)
        grid = make_starts(scenario, instance).grid
        seconds += [first.then(start) for start in grid]
    simulate_requests(seconds, output, scenario, workers, say)
    return len(seconds)
