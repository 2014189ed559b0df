"""Justifies the integrator and the contact meshes: the same reaches with finer and coarser ones.

    python scripts/convergence/run.py notebooks/results/convergence
    python scripts/convergence/run.py --scenario sphere-aperture-clutter --reaches 100 OUT

Random starts and goals in calibration environments, for the PR2 starts near the goal; one row per
variant: success rate and agreement with the reference. Existing reaches are reused.
"""

from pathlib import Path

import numpy as np

from lic_drake.evaluate.statistics import count, mcnemar
from lic_drake.evaluate.table import rate_cells
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.seeds import make_generator
from lic_drake.starts import board_starts
from scripts.common import add_workers, keep_reaches, make_parser, run_script, write_report

PLANAR = {
    "few steps where it is calm (chosen)": "",
    "CENIC, up to 10 ms": "cenic_max_step_s: 0.01",
    "CENIC, up to 20 ms": "cenic_max_step_s: 0.02",
    "CENIC, up to 5 ms": "cenic_max_step_s: 0.005",
    "CENIC, accuracy 1e-5": "cenic_accuracy: 1.0e-5",
    "meshes half as fine": "contact: {skin_mesh_m: 0.01, object_mesh_m: 0.008}",
    "meshes twice as fine": "contact: {skin_mesh_m: 0.0025, object_mesh_m: 0.002}",
    "discrete, 5 ms": "time_step_s: 0.005",
    "discrete, 0.5 ms": "time_step_s: 0.0005",
}
IN_SPACE = {
    "few steps where it is calm (chosen)": "",
    "CENIC, up to 20 ms": "cenic_max_step_s: 0.02",
    "CENIC, up to 10 ms": "cenic_max_step_s: 0.01",
    "CENIC, up to 40 ms": "cenic_max_step_s: 0.04",
    "meshes half as fine": "contact: {skin_mesh_m: 0.06, object_mesh_m: 0.04}",
    "CENIC, accuracy 1e-4": "cenic_accuracy: 1.0e-4",
    "meshes twice as fine": "contact: {skin_mesh_m: 0.015, object_mesh_m: 0.01}",
    "discrete, 2 ms": "time_step_s: 0.002",
}
"""Variants by name, all but the chosen one with error control in every step; the last one is what
the others are compared with."""

NEAR_STARTS = 3
"""In space, a reach starts at one of this many apertures nearest to the goal."""


def near_requests(scenario: Scenario, count: int) -> list[ReachRequest]:
    """Returns reaches from apertures near the goal; reaches from others hardly ever succeed."""
    requests = []
    for environment in range(count):
        instance = scenario.sample_instance("calibration", environment)
        p_WG = scenario.sample_goal("calibration", environment)
        starts = board_starts(scenario, instance).grid.without_q()
        apart = np.linalg.norm(starts.x0[:, 1:3] - p_WG[1:], axis=1)
        rng = make_generator("calibration", "near start", environment)
        i = int(rng.choice(np.argsort(apart)[:NEAR_STARTS]))
        requests.append(ReachRequest(scenario, "calibration", environment, p_WG, starts[i]))
    return requests


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("results", type=Path, help="folder for reaches and convergence.md")
    parser.add_argument("--scenario", default="cylinder-clutter")
    parser.add_argument("--reaches", type=int, default=200)
    add_workers(parser)
    args = parser.parse_args()
    in_plane = load_scenario(args.scenario).arm().is_planar
    rows = {}
    for name, changes in (PLANAR if in_plane else IN_SPACE).items():
        overrides = (
            f"{{scene: {{calm_move_m: 0, calm_change_N: 0.3, {changes}}}}}" if changes else ""
        )
        scenario = load_scenario(args.scenario, overrides)
        if in_plane:
            requests = random_requests(scenario, "calibration", -(-args.reaches // 5), 5)
        else:
            requests = near_requests(scenario, args.reaches)
        folder = args.results / "".join(c if c.isalnum() else "-" for c in name).strip("-")
        rows[name] = keep_reaches(requests[: args.reaches], folder, args.workers)
    last = list(rows)[-1]
    reference = np.array([record.success for record in rows[last]])
    lines = [
        f"| variant | success, % | 90 % interval | n | same outcome as {last}, % | McNemar p |",
        "|---|---|---|---|---|---|",
    ]
    for name, records in rows.items():
        won = np.array([record.success for record in records])
        rate, interval, _ = rate_cells(count(won))
        lines.append(
            f"| {name} | {rate} | {interval} | {len(won)} | {100 * np.mean(won == reference):.1f}"
            f" | {mcnemar(won, reference):.2f} |"
        )
    write_report(args.results / "convergence.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    run_script(main)
