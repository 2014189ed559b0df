"""Measures how much experience the PR2 needs, from every start or where the estimate says so.

python scripts/learning_curve/collection.py
"""

import tempfile
from pathlib import Path

from lic_drake.evaluate.statistics import count
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trial import Evaluation, run_evaluation
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import LocalWorkers
from lic_drake.paths import shipped_library
from scripts.common import add_results, add_workers, make_parser, run_script

CATEGORY = "sphere-aperture-clutter"
BLOCKED = "{clutter: {num_blocked: 10}}"
SIZES = {"active": (250, 1000, 3000), "random": (250, 1000, 3000, 9540)}
"""Numbers of reaches: of an active collection, or of random environments and every start there."""


def folder_of(results: Path) -> Path:
    """Returns the folder of the trials, and of the library that was collected actively."""
    return results / "learning_curve" / CATEGORY


def first_reaches(library: ExperienceLibrary, size: int, folder: Path) -> ExperienceLibrary:
    """Writes the reaches of the first environments, `size` of them, into a library."""
    records = sorted(library.records(), key=lambda record: record.environment)[:size]
    part = ExperienceLibrary(folder)
    part.write_shard("part", records, library.scenario())
    return part


def collection_table(results: Path) -> Table:
    """Returns LIC-1(GP)'s success, from the records, by what it learned from."""
    trials = TrialTable(read_trials(folder_of(results) / "evaluation" / "trials.parquet"))
    words = {"active": "where the estimate says so", "random": "every start"}
    rows = [
        (words[name], f"{size:,}", *rate_cells(count(trials.success("gp", 1, f"{name} {size}"))))
        for name, sizes in SIZES.items()
        for size in sizes
    ]
    return Table(
        caption="First attempts of LIC(GP), base and torso move, by what it learned from: starts"
        " proposed by COST and then by the estimate so far, with 10 of 20 apertures blocked, or"
        " every start to goals 0.2 m apart, with all of them open.",
        heading=("collected", "reaches", "success, %", "90 % interval", "count"),
        rows=tuple(rows),
    )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--environments", type=int, default=300)
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    folder = folder_of(args.results)
    libraries = {
        "active": ExperienceLibrary(folder / "training.parquet"),
        "random": ExperienceLibrary(shipped_library(CATEGORY)),
    }
    with tempfile.TemporaryDirectory() as parts, LocalWorkers(args.workers) as workers:
        for name, size in ((name, size) for name, sizes in SIZES.items() for size in sizes[::-1]):
            print(f"{size} reaches, {name}", flush=True)
            part = first_reaches(libraries[name], size, Path(parts) / f"{name}-{size}")
            evaluation = Evaluation(
                experience=part.path,
                results=folder / "evaluation",
                methods=("gp",),
                environments=args.environments,
                goals=1,
                attempts=1,
                scenario_name=CATEGORY,
                overrides=BLOCKED,
                variant=f"{name} {size}",
            )
            run_evaluation(evaluation, workers)


if __name__ == "__main__":
    run_script(main)
