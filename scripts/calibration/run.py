"""Measures RND's first attempt in training environments, which the scenario is calibrated on.

The paper's figures are those of 2,000 reaches (Tables I and III). Reaches are kept.

    python scripts/calibration/run.py notebooks/results/calibration/rnd
    python scripts/calibration/run.py notebooks/results/calibration/rnd-passage \
        --scenario passage-clutter --environments 300
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

from lic_drake.evaluate.batch import random_requests, simulate_requests
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.scenario import load_scenario

PAPER = {"cylinder-clutter": 61.0, "passage-clutter": 40.4, "cylinder-aperture-clutter": 17.2}
GOALS = 10
"""Goals in each environment, unless it offers one itself."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder of the library of reaches")
    parser.add_argument("--scenario", default="cylinder-clutter")
    parser.add_argument("--set", default="", help="YAML put over the scenario")
    parser.add_argument("--environments", type=int, default=100)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, args.set)
    goals = 1 if scenario.task.goal_area is None else GOALS
    requests = random_requests(scenario, "training", args.environments, goals)
    library = ExperienceLibrary(args.results)
    library.create()
    found = simulate_requests(requests, library, scenario, args.workers, print)
    records = [found[request.key] for request in requests]
    won = sum(record.success for record in records)
    low, high = wilson_interval(won, len(records))
    print(
        f"RND, first attempt: {100 * won / len(records):.1f} % of {len(records)}"
        f" (90 % interval {100 * low:.1f}..{100 * high:.1f}; paper {PAPER[scenario.category]} %);"
        f" {dict(Counter(record.outcome for record in records).most_common())};"
        f" scenario {scenario.digest}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
