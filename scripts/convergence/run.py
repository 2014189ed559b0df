"""Justifies the integrator and the contact meshes: the same reaches with finer and coarser ones.

Random starts and goals in calibration environments, for the PR2 starts near the goal; one row a
variant: success rate, how often the outcome equals the reference's, and cost. Reaches are kept and
not run again.

    python scripts/convergence/run.py notebooks/results/convergence
    python scripts/convergence/run.py --scenario sphere-aperture-clutter --reaches 100 OUT
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
from lic_drake.reach.pointing_starts import pointing_starts
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.seeds import make_generator

PLANAR = {
    "CENIC, up to 10 ms (chosen)": "{}",
    "CENIC, up to 20 ms": "{scene: {cenic_max_step_s: 0.02}}",
    "CENIC, up to 5 ms": "{scene: {cenic_max_step_s: 0.005}}",
    "CENIC, accuracy 1e-5": "{scene: {cenic_accuracy: 1.0e-5}}",
    "meshes half as fine": "{scene: {contact: {skin_mesh_m: 0.01, object_mesh_m: 0.008}}}",
    "meshes twice as fine": "{scene: {contact: {skin_mesh_m: 0.0025, object_mesh_m: 0.002}}}",
    "discrete, 5 ms": "{scene: {time_step_s: 0.005}}",
    "discrete, 0.5 ms": "{scene: {time_step_s: 0.0005}}",
}
IN_SPACE = {
    "CENIC, up to 20 ms (chosen)": "{}",
    "CENIC, up to 10 ms": "{scene: {cenic_max_step_s: 0.01}}",
    "CENIC, up to 40 ms": "{scene: {cenic_max_step_s: 0.04}}",
    "meshes half as fine": "{scene: {contact: {skin_mesh_m: 0.06, object_mesh_m: 0.04}}}",
    "CENIC, accuracy 1e-4": "{scene: {cenic_accuracy: 1.0e-4}}",
    "meshes twice as fine": "{scene: {contact: {skin_mesh_m: 0.015, object_mesh_m: 0.01}}}",
    "discrete, 2 ms": "{scene: {time_step_s: 0.002}}",
}
"""Variants by name; the last one is what the others are compared with."""

NEAR_STARTS = 3
"""In space a reach begins at one of so many apertures that are nearest to the goal."""


def near_requests(scenario: Scenario, count: int) -> list[ReachRequest]:
    """Returns reaches from apertures near the goal: from others hardly any comes through."""
    requests = []
    for environment in range(count):
        instance = scenario.sample_instance("calibration", environment)
        p_WG = scenario.sample_goal("calibration", environment)
        starts = pointing_starts(scenario, instance).grid
        apart = np.linalg.norm(starts.x0[:, 1:3] - p_WG[1:], axis=1)
        rng = make_generator("calibration", "near start", environment)
        i = int(rng.choice(np.argsort(apart)[:NEAR_STARTS]))
        requests.append(ReachRequest(scenario, "calibration", environment, p_WG, starts[i]))
    return requests


def run_variant(name: str, overrides: str, args: argparse.Namespace) -> list[ReachRecord]:
    """Returns the records of a variant, in the order of the requests."""
    scenario = load_scenario(args.scenario, overrides)
    folder = args.results / "".join(c if c.isalnum() else "-" for c in name).strip("-")
    library = ExperienceLibrary(folder)
    library.create()
    if scenario.arm().surface is None:
        requests = random_requests(scenario, "calibration", -(-args.reaches // 5), 5)
    else:
        requests = near_requests(scenario, args.reaches)
    requests = requests[: args.reaches]
    records = simulate_requests(
        requests, library, scenario, args.workers, lambda line: print(f"{name}: {line}")
    )
    return [records[request.key] for request in requests]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, help="folder for reaches and convergence.md")
    parser.add_argument("--scenario", default="cylinder-clutter")
    parser.add_argument("--reaches", type=int, default=200)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    args = parser.parse_args()
    variants = PLANAR if load_scenario(args.scenario).arm().surface is None else IN_SPACE
    rows = {name: run_variant(name, overrides, args) for name, overrides in variants.items()}
    last = list(variants)[-1]
    reference = np.array([record.success for record in rows[last]])
    lines = [
        f"| variant | success, % | 90 % interval | n | same outcome as {last}, % | McNemar p |"
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
