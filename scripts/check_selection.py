"""Checks selections against the library's own starts and a dense scan, on random goals.

For each estimator and optimiser: how often the selected start is at least as good as the best
start of the grid, how often it is within 1 % of the best of a dense scan over (y, phi), and the
time of a selection.

    python scripts/check_selection.py --out notebooks/results/selection.md
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import make_estimator
from lic_drake.evaluate.trial import planar_arm_of
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.select.lic import LbfgsbSelector, LicSelector
from lic_drake.select.situation import Situation, StartSet

SCAN = (161, 181)
"""Lattice of the dense scan: y every 5 mm, phi every degree."""

OPTIMISERS = {"MathematicalProgram": LicSelector, "L-BFGS-B": LbfgsbSelector}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=shipped_library("cylinder-clutter"))
    parser.add_argument("--situations", type=int, default=200)
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    parser.add_argument("--out", type=Path, help="Markdown file")
    args = parser.parse_args()
    library = ExperienceLibrary(args.library)
    scenario = library.scenario()
    arm = planar_arm_of(scenario)
    starts = StartSet(arm=arm, line=scenario.task.start_line)
    scan = starts.scan(*SCAN)
    rows = PLANAR_LIC1.rows(library.columns())
    goals = [scenario.sample_goal("holdout", i) for i in range(args.situations)]
    lines = [
        "| estimator | optimiser | situations | no worse than every grid start, % |"
        " within 1 % of the dense scan, % | largest shortfall, points | median s | largest s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in args.estimators:
        estimator = make_estimator(name).fit(rows.Z, rows.f, rows.environment)
        scans = [
            float(estimator.predict(PLANAR_LIC1.join(p_WG, scan)).probability.max())
            for p_WG in goals
        ]
        for optimiser, kind in OPTIMISERS.items():
            selector = kind(arm, estimator, PLANAR_LIC1, method=name)
            no_worse, within, shortfall, seconds = [], [], [], []
            for p_WG, best in zip(goals, scans, strict=True):
                chosen = selector.select(Situation(p_WG=p_WG, starts=starts))
                value = float(selector.evaluate(p_WG, chosen.x0[None])[0])
                grid = float(selector.evaluate(p_WG, starts.grid).max())
                no_worse.append(value >= grid - 1e-9)
                within.append(np.clip(value, 0.0, 1.0) >= 0.99 * best)
                shortfall.append(100.0 * (best - np.clip(value, 0.0, 1.0)))
                seconds.append(chosen.seconds)
            lines.append(
                f"| {name} | {optimiser} | {len(goals)} | {100 * np.mean(no_worse):.1f} |"
                f" {100 * np.mean(within):.1f} | {max(0.0, *shortfall):.2f} |"
                f" {np.median(seconds):.3f} | {max(seconds):.3f} |"
            )
            print(lines[-1], flush=True)
    if args.out:
        args.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
