"""Measures RND's first attempt in training environments, which scenarios are calibrated on.

    python scripts/calibration/run.py notebooks/results/calibration/rnd
    python scripts/calibration/run.py notebooks/results/calibration/rnd-passage \
        --scenario passage-clutter --environments 300

The paper's figures are those of 2,000 reaches (Tables I and III). Reaches are kept.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.table import rate_cells
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.scenario import load_scenario
from scripts.common import add_workers, keep_reaches, make_parser, run_script

PAPER = {"cylinder-clutter": 61.0, "passage-clutter": 40.4, "cylinder-aperture-clutter": 17.2}
GOALS = 10
"""Goals in each environment, unless it offers one itself."""


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("results", type=Path, help="folder of the library of reaches")
    parser.add_argument("--scenario", default="cylinder-clutter")
    parser.add_argument("--set", default="", help="YAML put over the scenario")
    parser.add_argument("--environments", type=int, default=100)
    add_workers(parser)
    args = parser.parse_args()
    scenario = load_scenario(args.scenario, args.set)
    goals = 1 if scenario.task.goal_area is None else GOALS
    requests = random_requests(scenario, "training", args.environments, goals)
    records = keep_reaches(requests, args.results, args.workers)
    rate, interval, counts = rate_cells(count(np.array([record.success for record in records])))
    print(
        f"RND, first attempt: {rate} % ({counts}, 90 % interval {interval};"
        f" paper {PAPER[scenario.category]} %);"
        f" {dict(Counter(record.outcome for record in records).most_common())};"
        f" scenario {scenario.digest}"
    )


if __name__ == "__main__":
    run_script(main)
