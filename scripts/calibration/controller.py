"""Compares controller and contact with the success rates that the authors published.

The authors' batch trials (gt-ros-pkg/hrl-haptic-manip, branch mpc_quasi-static_three_link_tests):
fixed cylinders in x 0.2..0.8, y -0.6..0.6 m, the 100 Hz controller with 5 N, eight goals a field
at 0.5, 0.6 and 0.7 m from the base within 30 degrees of straight ahead, one start posture. Their
result files say 77.3 % for 20 cylinders and 28.3 % for 80.

    python scripts/calibration/controller.py --out notebooks/results/calibration
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

import numpy as np

from lic_drake.evaluate.batch import simulate_requests
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.start import Start

PUBLISHED = {20: 77.3, 80: 28.3}
START_Q_DEG = (-50.0, 70.0, 145.0)


def goals() -> list[np.ndarray]:
    """Returns the eight goals p_WG: 3, 2 and 3 at growing distance, staggered."""
    polar = [(0.5, a) for a in (-30, 0, 30)] + [(0.6, a) for a in (-15, 15)]
    polar += [(0.7, a) for a in (-30, 0, 30)]
    return [np.array([r * np.cos(np.deg2rad(a)), r * np.sin(np.deg2rad(a)), 0.0]) for r, a in polar]


def field_requests(scenario: Scenario, fields: int) -> list[ReachRequest]:
    """Returns the reaches of all fields."""
    x0 = scenario.arm().tip_pose(np.deg2rad(START_Q_DEG))
    return [
        ReachRequest(scenario, "calibration", field, p_WG, Start(x0))
        for field in range(fields)
        for p_WG in goals()
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fields", type=int, default=25, help="fields of each density")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--out", type=Path, required=True, help="folder for reaches and the table")
    args = parser.parse_args()
    lines = [
        "| fixed cylinders | published, % | ours, % | 90 % interval | n | outcomes |",
        "|---|---|---|---|---|---|",
    ]
    for count, published in PUBLISHED.items():
        scenario = load_scenario("calibration-field", f"{{clutter: {{num_fixed: {count}}}}}")
        library = ExperienceLibrary(args.out / f"fixed-{count}")
        library.create()
        requests = field_requests(scenario, args.fields)
        found = simulate_requests(requests, library, scenario, args.workers, print)
        records = [found[request.key] for request in requests]
        won = sum(record.success for record in records)
        low, high = wilson_interval(won, len(records))
        outcomes = Counter(record.outcome for record in records).most_common()
        lines.append(
            f"| {count} | {published:.1f} | {100 * won / len(records):.1f} |"
            f" {100 * low:.1f}..{100 * high:.1f} | {len(records)} |"
            f" {', '.join(f'{name} {n}' for name, n in outcomes)} |"
        )
    text = "\n".join(lines) + "\n"
    (args.out / "calibration.md").write_text(text, encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
