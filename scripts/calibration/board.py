"""Which apertures of the board the PR2's arm can work through, with nothing behind the board.

python scripts/calibration/board.py --board-x 0.5 0.53 0.6 \
        --out notebooks/results/calibration/board.md
"""

from pathlib import Path

import numpy as np

from lic_drake.reach.environment import Environment
from lic_drake.reach.scenario import load_scenario
from lic_drake.starts import board_starts
from scripts.common import make_parser, run_script, write_report

OFFSETS = ((0.0, 0.0), (0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1))
"""Goals straight behind an aperture and beside, (y, z), metres."""


def scan(board_x: float, bar_m: float, depth_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns centres of apertures, shape (n, 3), and successes of five goals each, shape (n,)."""
    scenario = load_scenario(
        "sphere-aperture-clutter",
        f"{{clutter: {{num_spheres: 0, bar_m: {bar_m}, board_centre: [{board_x}, -0.29, 0.89],"
        f" lower: [{board_x + 0.1}, -0.6, 0.6], upper: [{board_x + 0.2}, 0.0, 1.0]}}}}",
    )
    instance = scenario.sample_instance("calibration", 0)
    starts = board_starts(scenario, instance).grid
    environment = Environment(scenario, instance, sleep=False)
    won = [
        sum(
            environment.reach(x0[:3] + [depth_m, *aside], x0).outcome == "reached"
            for aside in OFFSETS
        )
        for x0 in starts.x0
    ]
    return starts.x0[:, :3], np.array(won)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--board-x", type=float, nargs="+", default=[0.53], help="metres")
    parser.add_argument("--bar", type=float, default=0.01, help="width of a bar, metres")
    parser.add_argument("--depth", type=float, default=0.31, help="board to goals, metres")
    parser.add_argument("--out", type=Path, help="Markdown file")
    args = parser.parse_args()
    lines = ["Successes of five reaches through each aperture, with nothing behind the board."]
    for board_x in args.board_x:
        p_WA, won = scan(board_x, args.bar, args.depth)
        columns = sorted(set(np.round(p_WA[:, 1], 3)), reverse=True)
        lines += [
            "",
            f"Board at x {board_x} m, bars of {args.bar} m, goals {args.depth} m behind it:"
            f" {won.sum()} of {5 * len(won)}.",
            "",
            "| z \\ y, m | " + " | ".join(f"{y:.2f}" for y in columns) + " |",
            "|---" * (len(columns) + 1) + "|",
        ]
        for z in sorted(set(np.round(p_WA[:, 2], 3)), reverse=True):
            cells = []
            for y in columns:
                here = np.all(np.isclose(p_WA[:, 1:], [y, z], atol=1e-3), axis=1)
                cells.append(f"{won[here][0]}" if np.any(here) else "-")
            lines.append(f"| {z:.2f} | " + " | ".join(cells) + " |")
    write_report(args.out, "\n".join(lines) + "\n")


if __name__ == "__main__":
    run_script(main)
