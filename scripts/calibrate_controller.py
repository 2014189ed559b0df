"""Compares controller and contact with the success rates that the authors published.

The authors' batch trials (gt-ros-pkg/hrl-haptic-manip, branch mpc_quasi-static_three_link_tests):
fixed cylinders in x 0.2..0.8, y -0.6..0.6 m, the 100 Hz controller with 5 N, eight goals a field
at 0.5, 0.6 and 0.7 m from the base within 30 degrees of straight ahead, one start posture. Their
result files say 77.3 % for 20 cylinders and 28.3 % for 80.

    python scripts/calibrate_controller.py --fields 25 --out notebooks/results/calibration
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from lic_drake.experience.workers import prepare_worker
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario, load_scenario

PUBLISHED = {20: 77.3, 80: 28.3}
START_Q_DEG = (-50.0, 70.0, 145.0)


def goals() -> list[tuple[float, float, float]]:
    """Returns the eight goals p_WG: 3, 2 and 3 at growing distance, staggered."""
    polar = [(0.5, a) for a in (-30, 0, 30)] + [(0.6, a) for a in (-15, 15)]
    polar += [(0.7, a) for a in (-30, 0, 30)]
    return [
        (float(r * np.cos(np.deg2rad(a))), float(r * np.sin(np.deg2rad(a))), 0.0) for r, a in polar
    ]


def field_requests(scenario: Scenario, field: int) -> list[ReachRequest]:
    """Returns the reaches of one field."""
    x0 = scenario.arm().tip_pose(np.deg2rad(START_Q_DEG))
    start = (float(x0[0]), float(x0[1]), float(x0[2]))
    return [
        ReachRequest(
            scenario=scenario, stream="calibration", environment=field, goal=goal, start=start
        )
        for goal in goals()
    ]


def run_field(requests: list[ReachRequest]) -> list[ReachRecord]:
    return [run_reach(request) for request in requests]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fields", type=int, default=25, help="fields of each density")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--set", default="", help="YAML values over the calibration scenario")
    parser.add_argument("--out", type=Path, help="folder for calibration.md")
    args = parser.parse_args()
    lines = [
        "| fixed cylinders | published, % | ours, % | 90 % interval | n | outcomes |",
        "|---|---|---|---|---|---|",
    ]
    with ProcessPoolExecutor(
        args.workers, mp_context=get_context("forkserver"), initializer=prepare_worker
    ) as executor:
        for count, published in PUBLISHED.items():
            scenario = load_scenario("calibration-field", f"{{clutter: {{num_fixed: {count}}}}}")
            if args.set:
                scenario = load_scenario(
                    "calibration-field",
                    f"{{clutter: {{num_fixed: {count}}}, {args.set.strip().strip('{}')}}}",
                )
            tasks = [field_requests(scenario, field) for field in range(args.fields)]
            records = [record for rows in executor.map(run_field, tasks) for record in rows]
            won = sum(record.success for record in records)
            low, high = wilson_interval(won, len(records))
            outcomes = ", ".join(
                f"{name} {n}" for name, n in Counter(r.outcome for r in records).most_common()
            )
            lines.append(
                f"| {count} | {published:.1f} | {100 * won / len(records):.1f} |"
                f" {100 * low:.1f}..{100 * high:.1f} | {len(records)} | {outcomes} |"
            )
            print(lines[-1], flush=True)
    text = "\n".join(lines) + "\n"
    if args.out:
        args.out.mkdir(parents=True, exist_ok=True)
        (args.out / "calibration.md").write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
