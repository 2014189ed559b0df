"""How much a robot's own experience improves what a wrong simulation taught (paper VII)."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from matplotlib.axes import Axes

from lic_drake.errors import LibraryError
from lic_drake.evaluate.experiment import Evaluation, run_evaluation
from lic_drake.evaluate.statistics import Count, count
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialRow, TrialTable
from lic_drake.experience.added import add_records
from lic_drake.experience.added_rows import COLUMNS
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord

_COLORS = ("tab:blue", "tab:purple", "tab:cyan", "tab:olive", "tab:gray")


@dataclass(frozen=True, kw_only=True)
class Learned:
    """What an estimator learned from.

    Attributes:
        records: Number of records of the real robot, the first ones.
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
    learned: Learned,
    simulated: ExperienceLibrary,
    real: ExperienceLibrary,
    evaluation: Evaluation,
    workers: int = 1,
    say: Callable[[str], None] = print,
) -> list[TrialRow]:
    """Runs an evaluation of strategies that learned from a library and a robot's first records.

    The records enter as `lic experience add` lets them in, into a copy of the library.

    Args:
        learned: How many records, with which weight.
        simulated: The library that the simulation made.
        real: Stands for the real robot: reaches of another scenario of the same category.
        evaluation: Where, in which world (`overrides`) and with which methods to try; its library
            and its variant are replaced.
        workers: Number of processes.
        say: Gets a line now and then.

    Raises:
        LibraryError: There are fewer records, or a library cannot be used.
    """
    records = sorted(real.records(), key=lambda record: record.environment)[: learned.records]
    if len(records) < learned.records:
        raise LibraryError(f"{real.path} holds {len(records)} records, not {learned.records}")
    with TemporaryDirectory() as folder:
        library = ExperienceLibrary(Path(folder) / "library")
        values = {**vars(evaluation), "experience": library.path, "variant": learned.variant}
        if learned.weight is None:
            library.write_shard("real", records, real.scenario())
            values["overrides"] = ""
        else:
            shutil.copytree(simulated.path, library.path)
            if records:
                rows = map(to_row, records)
                add_records(library, rows, source="real", weight=learned.weight)
        return run_evaluation(Evaluation(**values), workers, say)


def to_row(record: ReachRecord) -> dict[str, object]:
    """Returns what a robot could have recorded of a planar reach, as it is added to a library."""
    values = asdict(record)
    return {name: values[name] for name, column in COLUMNS.items() if column.plane}


def success_by_records(
    trials: TrialTable, method: str, points: Sequence[Learned]
) -> dict[Learned, Count]:
    """Returns the success of first attempts for those points that were tried."""
    return {
        point: count(trials.success(method, 1, point.variant))
        for point in points
        if point.variant in trials.variants
    }


def real_experience_table(counts: dict[Learned, Count], random: Count, caption: str) -> Table:
    """Returns success by the number of records and their weight.

    Args:
        counts: Success of LIC-1.
        random: Of the records themselves: random starts in the same world.
        caption: What was tried.
    """
    rows = [
        (
            str(point.records),
            "no simulation" if point.weight is None else f"{point.weight:g}",
            *_cells(result),
        )
        for point, result in sorted(
            counts.items(), key=lambda item: (item[0].weight or 1e9, item[0].records)
        )
    ]
    return Table(
        caption=caption,
        heading=("real records", "weight", "success, %", "Wilson 90 % interval", "count"),
        rows=(*rows, ("random starts", "", *_cells(random))),
    )


def draw_success_by_records(ax: Axes, counts: dict[Learned, Count], random: Count) -> Axes:
    """Draws success against the number of records, a line for each weight, and returns the axes."""
    weights = sorted({point.weight for point in counts if point.records}, key=lambda w: w or 1e9)
    start = next((count for point, count in counts.items() if not point.records), None)
    for weight, color in zip(weights, _COLORS, strict=False):
        line = {p.records: c for p, c in counts.items() if p.weight == weight and p.records}
        if weight is not None and start is not None:
            line[0] = start
        sizes = sorted(line)
        rate = [100.0 * line[size].rate for size in sizes]
        ends = [line[size].interval() for size in sizes]
        low = [r - 100.0 * end[0] for r, end in zip(rate, ends, strict=True)]
        high = [100.0 * end[1] - r for r, end in zip(rate, ends, strict=True)]
        label = (
            "real records only"
            if weight is None
            else f"simulation and records of weight {weight:g}"
        )
        # Lines beside each other: intervals of equal sizes would hide one another.
        at = [size * 1.03 ** weights.index(weight) for size in sizes]
        ax.errorbar(at, rate, (low, high), color=color, marker="o", capsize=3, label=label)
    ax.axhline(100.0 * random.rate, color="tab:gray", linestyle="--", label="random starts")
    ax.set_xscale("symlog", linthresh=100)
    sizes = sorted({point.records for point in counts})
    ax.set_xticks(sizes, [str(size) for size in sizes])
    ax.minorticks_off()
    ax.set_xlim(-15.0, 1.2 * max(sizes))
    ax.set(ylim=(0.0, None), xlabel="records of the real robot", ylabel="success of LIC-1 [%]")
    ax.legend(fontsize=8, loc="lower right")
    return ax


def _cells(result: Count) -> tuple[str, str, str]:
    low, high = result.interval()
    return (
        f"{100 * result.rate:.1f}",
        f"{100 * low:.1f}..{100 * high:.1f}",
        f"{result.successes}/{result.trials}",
    )
