"""The numbers that describe a library at a glance."""

from collections import Counter
from dataclasses import dataclass

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import SIMULATION


@dataclass(frozen=True, kw_only=True)
class SourceSummary:
    """The rows of one source that is not the simulation.

    Attributes:
        source: Who made them.
        reaches: Number of rows.
        successes: How many of them reached their goal.
        weights: How many simulated reaches a row counts as, the different values, sorted.
    """

    source: str
    reaches: int
    successes: int
    weights: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LibrarySummary:
    """What a library holds; all numbers but `added` are of simulated reaches.

    Attributes:
        category: Clutter category.
        robot: Robot.
        scenario: Digest of the scenario.
        reaches: Number of rows.
        shards: Number of Parquet files.
        streams: Seed streams of the environments, sorted.
        environments: Number of different environments.
        goals: Number of different goals.
        starts: Number of different places and directions of the hand at the start.
        successes: Number of reaches that arrived at their goal.
        success_interval: Wilson 90 % interval of the success rate.
        outcomes: Outcome -> number of reaches, most frequent first.
        simulated_s: Simulated time of all reaches, seconds.
        wall_time_s: Wall time of all reaches, seconds.
        lic_drake_versions: Versions that simulated the reaches, sorted.
        drake_versions: Versions of Drake that simulated the reaches, sorted.
        added: Rows of real or other simulated robots, by source.
    """

    category: str
    robot: str
    scenario: str
    reaches: int
    shards: int
    streams: tuple[str, ...]
    environments: int
    goals: int
    starts: int
    successes: int
    success_interval: tuple[float, float]
    outcomes: dict[str, int]
    simulated_s: float
    wall_time_s: float
    lic_drake_versions: tuple[str, ...]
    drake_versions: tuple[str, ...]
    added: tuple[SourceSummary, ...]

    @property
    def success_rate(self) -> float:
        """Share of reaches that arrived at their goal; NaN without any."""
        return self.successes / self.reaches if self.reaches else float("nan")


def summarize(library: ExperienceLibrary) -> LibrarySummary:
    """Reads a library and returns its numbers.

    Raises:
        LibraryError: There is no library, it is empty, or it cannot be read.
    """
    everything = library.columns()
    is_simulated = everything["source"] == SIMULATION
    columns = {name: values[is_simulated] for name, values in everything.items()}
    reaches = len(columns["key"])
    added = []
    for source in sorted(set(everything["source"]) - {SIMULATION}):
        of_source = everything["source"] == source
        added.append(
            SourceSummary(
                source=source,
                reaches=int(of_source.sum()),
                successes=int(everything["success"][of_source].sum()),
                weights=tuple(sorted(set(everything["weight"][of_source].tolist()))),
            )
        )
    successes = int(columns["success"].sum())
    return LibrarySummary(
        category=str(everything["category"][0]),
        robot=str(everything["robot"][0]),
        scenario=str(everything["scenario"][0]),
        reaches=reaches,
        shards=len(library.shard_paths()),
        streams=tuple(sorted(set(columns["stream"]))),
        environments=len(set(zip(columns["stream"], columns["environment"], strict=True))),
        goals=len(set(zip(columns["goal_x"], columns["goal_y"], columns["goal_z"], strict=True))),
        starts=len(
            set(zip(*(columns[f"start_{axis}"] for axis in ("x", "y", "z", "phi")), strict=True))
        ),
        successes=successes,
        success_interval=wilson_interval(successes, reaches),
        outcomes=dict(Counter(map(str, columns["outcome"])).most_common()),
        simulated_s=float(columns["duration_s"].sum()),
        wall_time_s=float(columns["wall_time_s"].sum()),
        lic_drake_versions=tuple(sorted(set(columns["lic_drake_version"]))),
        drake_versions=tuple(sorted(set(columns["drake_version"]))),
        added=tuple(added),
    )
