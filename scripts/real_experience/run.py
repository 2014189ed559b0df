"""Measures what real records add to LIC-1 where the simulated passages are wrong.

    python scripts/real_experience/run.py

The "real" world is simulated, too: passages whose walls run 0 to 20 degrees to the left of +x,
where those of the library run 15 to 60 degrees to the left of it (paper VII). An interrupted run
can be resumed.
"""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lic_drake.errors import LibraryError
from lic_drake.evaluate.statistics import Count, count
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trial import Evaluation, random_requests, run_evaluation
from lic_drake.evaluate.trials import TrialTable, read_trials
from lic_drake.experience.add import add_rows, columns_of
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import LocalWorkers
from lic_drake.paths import shipped_library
from lic_drake.show.figures import save_figure
from scripts.common import (
    add_results,
    add_workers,
    keep_reaches,
    make_parser,
    run_script,
    write_tables,
)

CATEGORY = "passage-clutter"
REAL = "{clutter: {min_slope_deg: 0.0, max_slope_deg: 20.0}}"
METHOD = "gp1"


@dataclass(frozen=True, kw_only=True)
class Learned:
    """What an estimator learned from.

    Attributes:
        records: Number of records of the other world, the first ones.
        weight: How many simulated reaches each counts as; None: without any simulation.
    """

    records: int
    weight: float | None

    @property
    def variant(self) -> str:
        """Name of its trials."""
        how = "no simulation" if self.weight is None else f"weight {self.weight:g}"
        return f"{self.records} records, {how}" if self.records else "simulation"


def evaluate_learned(
    learned: Learned, real: ExperienceLibrary, evaluation: Evaluation, workers: int = 1
) -> None:
    """Runs an evaluation of strategies that learned from a library and a robot's first records.

    The records enter as `lic experience add` lets them in, into a copy of the library.

    Args:
        learned: How many records, with which weight.
        real: Stands for the real robot: reaches of another scenario of the same category.
        evaluation: Where, in which world (`overrides`) and with which methods to try.
        workers: Number of processes.

    Raises:
        LibraryError: There are fewer records, or a library cannot be used.
    """
    records = sorted(real.records(), key=lambda record: record.environment)[: learned.records]
    if len(records) < learned.records:
        raise LibraryError(f"{real.path} holds {len(records)} records, not {learned.records}")
    with TemporaryDirectory() as folder:
        library = ExperienceLibrary(Path(folder) / "library")
        tried = replace(evaluation, experience=library.path, variant=learned.variant)
        if learned.weight is None:
            library.write_shard("real", records, real.scenario())
            tried = replace(tried, overrides="")
        else:
            shutil.copytree(evaluation.experience, library.path)
            names = columns_of(library.scenario())
            rows = [{name: getattr(record, name) for name in names} for record in records]
            if rows:
                add_rows(library, rows, source="real", weight=learned.weight)
        with LocalWorkers(workers) as pool:
            run_evaluation(tried, pool, print)


def success_table(counts: dict[Learned, Count], random: Count) -> Table:
    """Tabulates success by number of records and weight.

    Args:
        counts: Success of LIC-1.
        random: Of the records themselves: random starts in the same world.
    """
    ordered = sorted(counts.items(), key=lambda item: (item[0].weight or 1e9, item[0].records))
    rows = [
        (
            str(point.records),
            "no simulation" if point.weight is None else f"{point.weight:g}",
            *rate_cells(result),
        )
        for point, result in ordered
    ]
    return Table(
        caption=f"First attempts in {CATEGORY} whose walls run 0 to 20 degrees from +x, after"
        " learning from a simulation in which they run 15 to 60 degrees from it and from"
        " records of random starts.",
        heading=("real records", "weight", "success, %", "Wilson 90 % interval", "count"),
        rows=(*rows, ("random starts", "", *rate_cells(random))),
    )


def draw_success(ax: Axes, counts: dict[Learned, Count], random: Count) -> None:
    """Draws success against the number of records, a line for each weight."""
    weights = sorted({point.weight for point in counts if point.records}, key=lambda w: w or 1e9)
    start = next((count for point, count in counts.items() if not point.records), None)
    for weight, color in zip(weights, ("tab:blue", "tab:purple", "tab:cyan"), strict=False):
        line = {p.records: c for p, c in counts.items() if p.weight == weight and p.records}
        if weight is not None and start is not None:
            line[0] = start
        sizes = sorted(line)
        rate = [100.0 * line[size].rate for size in sizes]
        ends = [line[size].interval() for size in sizes]
        low = [r - 100.0 * end[0] for r, end in zip(rate, ends, strict=True)]
        high = [100.0 * end[1] - r for r, end in zip(rate, ends, strict=True)]
        learned = "these records only" if weight is None else "simulation and records of weight"
        label = learned if weight is None else f"{learned} {weight:g}"
        # Lines beside each other: intervals of equal sizes would hide one another.
        at = [size * 1.03 ** weights.index(weight) for size in sizes]
        ax.errorbar(at, rate, (low, high), color=color, marker="o", capsize=3, label=label)
    ax.axhline(100.0 * random.rate, color="tab:gray", linestyle="--", label="random starts")
    ax.set_xscale("symlog", linthresh=100)
    sizes = sorted({point.records for point in counts})
    ax.set_xticks(sizes, [str(size) for size in sizes])
    ax.minorticks_off()
    ax.set_xlim(-15.0, 1.2 * max(sizes))
    ax.set(ylim=(0.0, None), xlabel="records of the other world", ylabel="success of LIC-1 [%]")
    ax.legend(fontsize=8, loc="lower right")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--records", type=int, default=2000, help="records of the other world")
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 300, 1000, 2000])
    parser.add_argument("--weights", type=float, nargs="+", default=[1.0, 8.0])
    parser.add_argument(
        "--alone", type=int, nargs="*", default=[300, 2000], help="sizes without the simulation"
    )
    parser.add_argument("--environments", type=int, default=300, help="goals at each point")
    parser.add_argument(
        "--tabulate", action="store_true", help="only table and figure, of what was tried before"
    )
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    folder = args.results / "real_experience"
    points = [Learned(records=0, weight=1.0)]
    points += [Learned(records=n, weight=w) for w in args.weights for n in args.sizes]
    points += [Learned(records=n, weight=None) for n in args.alone]
    evaluation = Evaluation(
        experience=shipped_library(CATEGORY),
        results=folder,
        methods=(METHOD,),
        environments=args.environments,
        goals=1,
        attempts=1,
        overrides=REAL,
    )
    real = ExperienceLibrary(folder / "records")
    if not args.tabulate:
        scenario = evaluation.scenario()
        requests = random_requests(scenario, "training", args.records, 1)
        keep_reaches(requests, real.path, args.workers)
        for point in points:
            print(point.variant, flush=True)
            evaluate_learned(point, real, evaluation, args.workers)
    trials = TrialTable(read_trials(evaluation.trials_path))
    tried = [point for point in points if point.variant in trials.variants]
    counts = {point: count(trials.success(METHOD, 1, point.variant)) for point in tried}
    random = count(real.columns()["success"].astype(bool))
    write_tables(args.results, "real_experience", [success_table(counts, random)])
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    draw_success(figure.subplots(), counts, random)
    path = args.results / "figures" / "real_experience.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


if __name__ == "__main__":
    run_script(main)
