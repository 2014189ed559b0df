"""Justifies the integrator and the contact meshes: the same reaches with finer and coarser ones.

Random starts and goals in calibration environments, one row a variant: success rate, how often
the outcome equals that of the 0.5 ms reference, and cost. Reaches are kept and not run again.

    python scripts/convergence_study.py notebooks/results/convergence
"""

import argparse
import os
import sys
from pathlib import Path

import numpy as np

from lic_drake.evaluate.batch import random_requests, simulate_requests
from lic_drake.evaluate.statistics import mcnemar
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import load_scenario

VARIANTS = {
    "CENIC, up to 10 ms (chosen)": "{}",
    "CENIC, up to 20 ms": "{scene: {cenic_max_step_s: 0.02}}",
    "CENIC, up to 5 ms": "{scene: {cenic_max_step_s: 0.005}}",
    "CENIC, accuracy 1e-5": "{scene: {cenic_accuracy: 1.0e-5}}",
    "meshes half as fine": "{scene: {contact: {skin_mesh_m: 0.01, object_mesh_m: 0.008}}}",
    "meshes twice as fine": "{scene: {contact: {skin_mesh_m: 0.0025, object_mesh_m: 0.002}}}",
    "discrete, 5 ms": "{scene: {time_step_s: 0.005}}",
    "discrete, 0.5 ms": "{scene: {time_step_s: 0.0005}}",
}
REFERENCE = "discrete, 0.5 ms"


def run_variant(name: str, args: argparse.Namespace) -> list[ReachRecord]:
    """Returns the records of a variant, in the order of the requests."""
    scenario = load_scenario("cylinder-clutter", VARIANTS[name])
    folder = args.results / "".join(c if c.isalnum() else "-" for c in name).strip("-")
    library = ExperienceLibrary(folder)
    library.create()
    requests = random_requests(scenario, "calibration", -(-args.reaches // 5), 5)[: args.reaches]
    records = simulate_requests(
        requests, library, scenario, args.workers, lambda line: print(f"{name}: {line}")
    )
    return [records[request.key] for request in requests]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder for reaches and convergence.md")
    parser.add_argument("--reaches", type=int, default=200)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    rows = {name: run_variant(name, args) for name in VARIANTS}
    reference = np.array([record.success for record in rows[REFERENCE]])
    lines = [
        "| variant | success, % | 90 % interval | n | same outcome as 0.5 ms, % | McNemar p |"
        " wall s per simulated s |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, records in rows.items():
        won = np.array([record.success for record in records])
        low, high = wilson_interval(int(won.sum()), len(won))
        cost = sum(r.wall_time_s for r in records) / sum(r.duration_s for r in records)
        lines.append(
            f"| {name} | {100 * won.mean():.1f} | {100 * low:.1f}..{100 * high:.1f} | {len(won)} |"
            f" {100 * np.mean(won == reference):.1f} | {mcnemar(won, reference):.2f} |"
            f" {cost:.3f} |"
        )
    text = "\n".join(lines) + "\n"
    (args.results / "convergence.md").write_text(text, encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
