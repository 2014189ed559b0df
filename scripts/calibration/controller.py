"""Compares controller and contact with the success rates that the authors published.

    python scripts/calibration/controller.py --out notebooks/results/calibration

The authors' batch trials (gt-ros-pkg/hrl-haptic-manip, branch mpc_quasi-static_three_link_tests):
fixed cylinders in x 0.2..0.8, y -0.6..0.6 m, the 100 Hz controller with 5 N, eight goals a field
at 0.5, 0.6 and 0.7 m from the base within 30 degrees of straight ahead, one start posture. Their
result files say 77.3 % for 20 cylinders and 28.3 % for 80.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.table import rate_cells
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.start import Start
from scripts.common import add_workers, keep_reaches, make_parser, run_script, write_report

PUBLISHED = {20: 77.3, 80: 28.3}
START_Q_DEG = (-50.0, 70.0, 145.0)
GOALS = tuple((r, a) for r in (0.5, 0.6, 0.7) for a in ((-15, 15) if r == 0.6 else (-30, 0, 30)))
"""Distance in metres and angle in degrees of the eight goals."""


def field_requests(scenario: Scenario, fields: int) -> list[ReachRequest]:
    """Returns the reaches of all fields."""
    start = Start(scenario.arm().tip_pose(np.deg2rad(START_Q_DEG)))
    goals = [np.array([r * np.cos(np.deg2rad(a)), r * np.sin(np.deg2rad(a)), 0]) for r, a in GOALS]
    return [
        ReachRequest(scenario, "calibration", field, p_WG, start)
        for field in range(fields)
        for p_WG in goals
    ]


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--fields", type=int, default=25, help="fields of each density")
    parser.add_argument("--out", type=Path, required=True, help="folder for reaches and the table")
    add_workers(parser)
    args = parser.parse_args()
    lines = [
        "| fixed cylinders | published, % | ours, % | 90 % interval | n | outcomes |",
        "|---|---|---|---|---|---|",
    ]
    for cylinders, published in PUBLISHED.items():
        scenario = load_scenario("calibration-field", f"{{clutter: {{num_fixed: {cylinders}}}}}")
        requests = field_requests(scenario, args.fields)
        records = keep_reaches(requests, args.out / f"fixed-{cylinders}", args.workers)
        rate, interval, _ = rate_cells(count(np.array([record.success for record in records])))
        outcomes = Counter(record.outcome for record in records).most_common()
        ended = ", ".join(f"{name} {n}" for name, n in outcomes)
        lines.append(
            f"| {cylinders} | {published:.1f} | {rate} | {interval} | {len(records)} | {ended} |"
        )
    write_report(args.out / "calibration.md", "\n".join(lines) + "\n")


if __name__ == "__main__":
    run_script(main)
