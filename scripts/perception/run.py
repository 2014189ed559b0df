"""Measures perception in random scenes of the foliage: apertures, which of them are open, the goal.

    python scripts/perception/run.py notebooks/results/perception

Writes perception.md, apertures.parquet and goals.parquet; existing scenes are not measured
again. The scenes are environments of the evaluation stream, which nothing was tuned on.
"""

from dataclasses import asdict
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from lic_drake.perception.config import CamerasConfig, load_cameras
from lic_drake.reach.scenario import Scenario, load_scenario
from scripts.common import make_parser, run_script
from scripts.perception.errors import (
    ApertureError,
    GoalError,
    measure_scene,
    perception_report,
)

SAVE_EVERY = 20
"""Number of scenes between two writes of the results."""


def save(
    results: Path,
    scenario: Scenario,
    cameras: CamerasConfig,
    apertures: list[ApertureError],
    goals: list[GoalError],
) -> str:
    """Writes what was measured so far, and returns the report."""
    results.mkdir(parents=True, exist_ok=True)
    for name, rows in (("apertures", apertures), ("goals", goals)):
        table = pa.Table.from_pylist([asdict(row) for row in rows])
        pq.write_table(table, results / f"{name}.parquet", compression="zstd")
    camera = cameras.head.camera
    text = (
        "# Perception of the foliage's apertures and goal\n\n"
        f"`python scripts/perception/run.py` in {len(goals) // 2} scenes of"
        f" {scenario.category} (scenario {scenario.digest}). Cameras' errors: depth"
        f" {1e3 * camera.noise.depth_sigma_per_m:.2f} mm (standard deviation) and steps of"
        f" {1e3 * camera.noise.depth_step_per_m:.2f} mm at 1 m, growing with its square; pose"
        f" {1e3 * camera.pose_error.translation_m:.1f} mm and {camera.pose_error.rotation_deg}"
        " degrees along and about each axis.\n\n" + perception_report(apertures, goals)
    )
    (results / "perception.md").write_text(text, encoding="utf-8")
    return text


def load[Row: (ApertureError, GoalError)](path: Path, kind: type[Row]) -> list[Row]:
    """Returns the rows of an earlier run, which is taken up again."""
    return [kind(**row) for row in pq.read_table(path).to_pylist()] if path.is_file() else []


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("results", type=Path, help="folder for the results")
    parser.add_argument("--scenario", default="foliage-aperture-clutter")
    parser.add_argument("--cameras", default="foliage")
    parser.add_argument("--scenes", type=int, default=200)
    args = parser.parse_args()
    scenario, cameras = load_scenario(args.scenario), load_cameras(args.cameras)
    apertures = load(args.results / "apertures.parquet", ApertureError)
    goals = load(args.results / "goals.parquet", GoalError)
    text = perception_report(apertures, goals) if goals else ""
    for scene in tqdm(range(len(goals) // 2, args.scenes), unit="scene"):
        of_board, of_goal = measure_scene(scenario, cameras, scene)
        apertures += of_board
        goals += of_goal
        if (scene + 1) % SAVE_EVERY == 0 or scene + 1 == args.scenes:
            text = save(args.results, scenario, cameras, apertures, goals)
    print(text, end="")


if __name__ == "__main__":
    run_script(main)
