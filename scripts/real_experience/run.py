"""Measures how LIC-1 gains from a real robot's records where the simulated passages are wrong.

python scripts/real_experience/run.py

The "real" world is simulated, too: passages whose walls run straight ahead, -10 to 10 degrees from
+x, where those of the library lean to the left by 5 to 35 degrees. Run again, it goes on where it
was.
"""

import argparse
import sys
from pathlib import Path

from matplotlib.figure import Figure

from lic_drake.errors import LicError
from lic_drake.evaluate.batch import random_requests, simulate_requests
from lic_drake.evaluate.experiment import Evaluation
from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.show.plots import save_figure
from scripts.common import RESULTS, write_table_files
from scripts.real_experience.learned import (
    Learned,
    draw_success_by_records,
    evaluate_learned,
    real_experience_table,
    success_by_records,
)

CATEGORY = "passage-clutter"
REAL = "{clutter: {min_slope_deg: -10.0, max_slope_deg: 10.0}}"
METHOD = "gp1"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder of all records")
    parser.add_argument("--records", type=int, default=2000, help="records of the real robot")
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 300, 1000, 2000])
    parser.add_argument("--weights", type=float, nargs="+", default=[1.0, 8.0])
    parser.add_argument(
        "--alone", type=int, nargs="*", default=[300, 2000], help="sizes without the simulation"
    )
    parser.add_argument("--environments", type=int, default=300, help="goals at each point")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument(
        "--tabulate", action="store_true", help="only table and figure, of what was tried before"
    )
    args = parser.parse_args()
    folder = args.results / "real_experience"
    points = [Learned(records=0, weight=1.0)]
    points += [Learned(records=n, weight=w) for w in args.weights for n in args.sizes]
    points += [Learned(records=n, weight=None) for n in args.alone]
    simulated = ExperienceLibrary(shipped_library(CATEGORY))
    evaluation = Evaluation(
        experience=simulated.path,
        results=folder,
        methods=(METHOD,),
        environments=args.environments,
        goals=1,
        attempts=1,
        overrides=REAL,
    )
    try:
        scenario, real = evaluation.scenario(), ExperienceLibrary(folder / "records")
        if not args.tabulate:
            real.create()
            requests = random_requests(scenario, "training", args.records, 1)
            simulate_requests(requests, real, scenario, args.workers, print)
            for point in points:
                print(point.variant, flush=True)
                evaluate_learned(point, simulated, real, evaluation, args.workers)
        trials = TrialTable(read_trials(evaluation.trials_path))
        counts = success_by_records(trials, METHOD, points)
        random = count(real.columns()["success"].astype(bool))
        caption = (
            f"First attempts in {CATEGORY} whose walls run -10 to 10 degrees from +x, after"
            " learning from a simulation in which they run 5 to 35 degrees from it and from"
            " records of random starts."
        )
        table = real_experience_table(counts, random, caption)
        paths = write_table_files(args.results, "real_experience", [table])
        figure = Figure(figsize=(7.0, 4.5), layout="constrained")
        draw_success_by_records(figure.subplots(), counts, random)
        paths.append(args.results / "figures" / "real_experience.png")
        save_figure(figure, paths[-1])
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for path in paths:
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
