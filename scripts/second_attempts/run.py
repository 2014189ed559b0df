"""Makes second attempts after failures of LIC-1 in training environments, as a library for LIC-2.

    python scripts/second_attempts/run.py models/experience/cylinder-clutter \
        notebooks/results/second_attempts/cylinder-clutter --first 20 --environments 20

LIC-1 reaches for every goal; where that fails, a second reach is made from every discrete start in
the environment as the first one left it (paper III-C).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRequest
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import Situation
from lic_drake.starts import make_starts
from scripts.common import add_workers, keep_reaches, make_parser, run_script


def collect(
    experience: ExperienceLibrary, output: Path, environments: Sequence[int], workers: int = 1
) -> int:
    """Makes the reaches and returns the number of second attempts.

    Args:
        experience: What LIC-1 learns from; gives the scenario.
        output: Folder for first and second attempts.
        environments: Indices of training environments, better none that `experience` holds.
        workers: Number of processes.
    """
    scenario = experience.scenario()
    columns = experience.columns()
    selector = make_selector("gp1", scenario.arm(), columns, category=scenario.category)
    firsts: list[ReachRequest] = []
    for environment in environments:
        starts = make_starts(scenario, scenario.sample_instance("training", environment))
        for p_WG in scenario.goals("training", environment):
            chosen = selector.select(Situation(p_WG=p_WG, starts=starts))
            firsts.append(ReachRequest(scenario, "training", environment, p_WG, chosen.start))
    print(f"{len(firsts)} first attempts chosen", flush=True)
    records = keep_reaches(firsts, output, workers)
    seconds: list[ReachRequest] = []
    for first, record in zip(firsts, records, strict=True):
        if record.success or not np.isfinite(record.final_x):
            continue
        instance = scenario.sample_instance("training", first.environment)
        grid = make_starts(scenario, instance).grid.without_q()
        seconds += [first.then(start) for start in grid]
    keep_reaches(seconds, output, workers)
    return len(seconds)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("library", type=Path, help="library that LIC-1 learns from")
    parser.add_argument("output", type=Path, help="folder for the attempts")
    parser.add_argument("--first", type=int, default=20, help="index of the first environment")
    parser.add_argument("--environments", type=int, default=20)
    add_workers(parser)
    args = parser.parse_args()
    environments = range(args.first, args.first + args.environments)
    count = collect(ExperienceLibrary(args.library), args.output, environments, args.workers)
    print(f"{count} second attempts in {args.output}")


if __name__ == "__main__":
    run_script(main)
