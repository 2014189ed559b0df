"""What LIC-1 gains over COST among cylinders if what the paper leaves open were otherwise.

    python scripts/sensitivity/run.py --out notebooks/results/sensitivity

Each variant is 40 environments with the same 15 goals, each tried from all 21 starts. LIC chooses
among them by what the estimator learns in the environments of the other folds, so that all
strategies are read from the same reaches. A first attempt each; ± is a standard error over
environments.
"""

from functools import partial
from pathlib import Path

import numpy as np

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import make_estimator
from lic_drake.estimate.rows import group_folds
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.table import Table
from lic_drake.experience.collect import CollectionRequest
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario
from scripts.ablation.run import Choices, blocks, held_out_values
from scripts.bounds.table import cost_score
from scripts.common import add_workers, keep_reaches, make_parser, run_script, write_report

GOALS = "task: {goal_area: {step_m: 0.2}}"
FASTER = "mpc: {preset: haptic_mpc_2013}"
PATIENT = "stop: {stuck_distance_m: 0.005, stuck_time_s: 3.0}"
VARIANTS = {
    "as shipped": "",
    "controller haptic_mpc_2013": FASTER,
    "stuck: less than 5 mm in 3 s": PATIENT,
    "haptic_mpc_2013, 5 mm in 3 s": f"{FASTER}, {PATIENT}",
    "skin a tenth as stiff": "scene: {contact: {skin_modulus_Pa: 1.0e+7}}",
    "skin a hundredth as stiff": "scene: {contact: {skin_modulus_Pa: 1.0e+6}}",
    "half the friction between bodies": "scene: {contact: {object_friction: 0.1}}",
    "twice the friction between bodies": "scene: {contact: {object_friction: 0.4}}",
    "half the friction of the ground": "scene: {ground_friction_N: 1.0}",
    "twice the friction of the ground": "scene: {ground_friction_N: 4.0}",
    "force limit 50 N": "stop: {force_limit_N: 50.0}",
}
"""YAML over the shipped scenario, by what it says."""


def compare(library: ExperienceLibrary) -> tuple[str, ...]:
    """Returns a variant's cells: RND, COST, LIC, the oracle, LIC - COST and McNemar's p."""
    columns = library.columns()
    rows = PLANAR_LIC1.rows(columns)
    order, size = blocks(columns, ("stream", "environment", "goal_x", "goal_y"))
    success, environment = rows.y[order].reshape(-1, size), rows.groups[order][::size]
    choices = Choices(success, np.ones(len(success)), environment)
    make = partial(make_estimator, "gp")
    estimate = held_out_values(make, rows, group_folds(rows.groups, 10))
    lic = choices.share(estimate[order].reshape(-1, size))
    by_cost = choices.share(cost_score(columns)[order].reshape(-1, size))
    found = (choices.success.mean(axis=1), by_cost, lic, choices.success.max(axis=1), lic - by_cost)
    cells = ["{:.1f} ± {:.1f}".format(*choices.mean(values)) for values in found]
    return (*cells, f"{mcnemar(lic > 0.5, by_cost > 0.5):.2g}")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--environments", type=int, default=40)
    parser.add_argument("--reaches", type=Path, default=Path("out/sensitivity"), help="folder")
    parser.add_argument("--out", type=Path, required=True, help="folder of the table")
    add_workers(parser)
    args = parser.parse_args()
    table = []
    for name, override in VARIANTS.items():
        scenario = load_scenario(
            "cylinder-clutter", f"{{{', '.join(part for part in (GOALS, override) if part)}}}"
        )
        request = CollectionRequest(
            scenario=scenario, stream="holdout", environments=args.environments
        )
        folder = args.reaches / scenario.digest
        keep_reaches(list(request.all_reaches()), folder, args.workers)
        table.append((name, *compare(ExperienceLibrary(folder))))
        heading = ("variant", "RND", "COST", "LIC(GP)", "oracle", "LIC - COST, points", "p")
        done = Table(caption="First attempts, %.", heading=heading, rows=tuple(table))
        write_report(args.out / "sensitivity.md", done.to_markdown())


if __name__ == "__main__":
    run_script(main)
