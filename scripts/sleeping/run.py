"""Compares reaches in which untouched objects sleep with the same reaches with all of them awake.

    python scripts/sleeping/run.py out/sleeping --report notebooks/results/sleeping.md

Random starts and goals in calibration environments. Reports how many outcomes differ and by how
much the fields of the records do. Existing reaches are reused.
"""

from pathlib import Path

import numpy as np

from lic_drake.evaluate.statistics import mcnemar
from lic_drake.evaluate.trial import random_requests
from lic_drake.reach.scenario import load_scenario
from scripts.common import add_workers, keep_reaches, make_parser, run_script, write_report

FIGURES = ("final_x", "final_y", "final_phi", "min_distance", "peak_force", "duration_s")

TIGHT = 1e-9
"""Tolerance within which two final poses agree, metres and radians."""


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("reaches", type=Path, help="folder for the reaches")
    parser.add_argument("--report", type=Path, help="Markdown file")
    parser.add_argument("--count", type=int, default=1000)
    add_workers(parser)
    args = parser.parse_args()
    scenario = load_scenario("cylinder-clutter")
    requests = random_requests(scenario, "calibration", -(-args.count // 5), 5)[: args.count]
    asleep, awake = (
        keep_reaches(requests, args.reaches / name, args.workers, sleep=sleep)
        for name, sleep in (("asleep", True), ("awake", False))
    )
    pairs = [
        (a, b) for a, b in zip(asleep, awake, strict=True) if a.duration_s > 0.0 < b.duration_s
    ]
    won = np.array([[a.success, b.success] for a, b in zip(asleep, awake, strict=True)])
    outcomes = sum(a.outcome != b.outcome for a, b in zip(asleep, awake, strict=True))
    apart = np.array([[abs(getattr(a, f) - getattr(b, f)) for f in FIGURES] for a, b in pairs])
    close = np.mean(apart[:, :3].max(axis=1) < TIGHT)
    lines = [
        f"- {len(asleep)} requests, {len(pairs)} simulated in both ways",
        f"- other outcome: {outcomes} ({100 * outcomes / len(asleep):.2f} %)",
        f"- success: {100 * won[:, 0].mean():.1f} % asleep, {100 * won[:, 1].mean():.1f} % awake;"
        f" only asleep {int(np.sum(won[:, 0] & ~won[:, 1]))}, only awake"
        f" {int(np.sum(~won[:, 0] & won[:, 1]))}, McNemar p = {mcnemar(won[:, 0], won[:, 1]):.2f}",
        f"- same final pose within {TIGHT:g}: {100 * close:.1f} %",
        "",
        "| figure | median difference | 95th percentile | largest |",
        "|---|---|---|---|",
        *(
            f"| {name} | {np.median(d):.1e} | {np.quantile(d, 0.95):.1e} | {d.max():.1e} |"
            for name, d in zip(FIGURES, apart.T, strict=True)
        ),
    ]
    write_report(args.report, "\n".join(lines) + "\n")


if __name__ == "__main__":
    run_script(main)
