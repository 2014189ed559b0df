"""Measures RND's first attempt in training environments, which the scenario is calibrated on.

The paper's figure for cylinder-clutter is 61.0 % of 2,000 (Table I). Reaches are kept.

    python scripts/calibrate_scenario.py notebooks/results/calibration/rnd
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

PAPER = 61.0
GOALS = 10


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder of the library of reaches")
    parser.add_argument("--scenario", default="cylinder-clutter")
    parser.add_argument("--environments", type=int, default=100, help="ten goals in each")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario)
    requests = random_requests(scenario, "training", args.environments, GOALS)
    library = ExperienceLibrary(args.results)
    library.create()
    found = simulate_requests(requests, library, scenario, args.workers, print)
    records = [found[request.key] for request in requests]
    won = sum(record.success for record in records)
    low, high = wilson_interval(won, len(records))
    print(
        f"RND, first attempt: {100 * won / len(records):.1f} % of {len(records)}"
        f" (90 % interval {100 * low:.1f}..{100 * high:.1f}; paper {PAPER} %);"
        f" {dict(Counter(record.outcome for record in records).most_common())};"
        f" scenario {scenario.digest}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
