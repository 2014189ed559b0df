"""Measures both attempts of RND with candidate values of a scenario, against the paper's counts.

    python scripts/calibration/run.py cylinder-clutter out/candidate
    python scripts/calibration/run.py passage-clutter out/candidate --environments 400 --goals 1 \
        --set "{clutter: {min_slope_deg: 0}}"

Environments come from the stream `calibration`, which nothing is learned or evaluated in. Trials
and reaches are kept, and continued. G is the likelihood-ratio statistic of the hypothesis that both
attempts succeed as often as in the paper: 0 if all rates are equal, over 6.0 (chi-square, two
degrees of freedom) at the 5 % level.
"""

from pathlib import Path

import numpy as np
from scipy.special import xlogy

from lic_drake.evaluate.paper import TABLES
from lic_drake.evaluate.statistics import Count, count
from lic_drake.evaluate.table import rate_cells
from lic_drake.evaluate.trial import Evaluation, run_evaluation
from lic_drake.evaluate.trials import TrialTable
from lic_drake.experience.workers import LocalWorkers
from lic_drake.paths import shipped_library
from lic_drake.reach.scenario import Scenario
from scripts.common import add_workers, make_parser, run_script

STREAM = "calibration"


def likelihood_ratio(ours: Count, paper: Count) -> float:
    """Returns twice the log likelihood that two success rates gain over a common one."""
    both = Count(*np.add(ours, paper))

    def log_likelihood(counts: Count, rate: float) -> float:
        failures = counts.trials - counts.successes
        return float(xlogy(counts.successes, rate) + xlogy(failures, 1.0 - rate))

    gained = [log_likelihood(c, c.rate) - log_likelihood(c, both.rate) for c in (ours, paper)]
    return 2.0 * sum(gained)


def out_of_reach(scenario: Scenario, environments: int, goals: int) -> float:
    """Returns the share of goals farther from the base's track than the arm is long."""
    arm, track = scenario.arm(), scenario.task.base
    length = np.linalg.norm(np.diff(arm.p_RJ, axis=0), axis=1).sum()
    p_WG = np.array(
        [scenario.sample_goal(STREAM, e, g) for e in range(environments) for g in range(goals)]
    )
    low, high = (0.0, 0.0) if track is None else (track.y_min_m, track.y_max_m)
    aside = p_WG[:, 1] - np.clip(p_WG[:, 1], low, high)
    far = np.hypot(p_WG[:, 0], aside) > length + scenario.stop.success_distance_m
    return float(far.mean())


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("scenario", choices=sorted(TABLES), help="shipped scenario")
    parser.add_argument("results", type=Path, help="folder of trials and reaches")
    parser.add_argument("--set", default="", help="YAML put over the scenario")
    parser.add_argument("--environments", type=int, default=200)
    parser.add_argument("--goals", type=int, default=10, help="in each environment")
    parser.add_argument("--methods", nargs="+", default=["rnd"], help="RND alone, until frozen")
    add_workers(parser)
    args = parser.parse_args()
    evaluation = Evaluation(
        experience=shipped_library(args.scenario),
        results=args.results,
        methods=tuple(args.methods),
        environments=args.environments,
        goals=args.goals,
        stream=STREAM,
        overrides=args.set,
        scenario_name=args.scenario,
    )
    with LocalWorkers(args.workers) as workers:
        table = TrialTable(run_evaluation(evaluation, workers))
    far = out_of_reach(evaluation.scenario(), args.environments, args.goals)
    for method in args.methods:
        attempts = count(table.success(method, 1)), table.conditional(method, 2)
        column = TABLES[args.scenario].columns[method]
        distance = sum(map(likelihood_ratio, attempts, (column.first, column.second)))
        cells = [f"{rate} ({counts})" for rate, _, counts in map(rate_cells, attempts)]
        print(f"| {args.set} | {method} | {' | '.join(cells)} | {distance:.1f} | {100 * far:.1f} |")


if __name__ == "__main__":
    run_script(main)
