"""The numbers that describe a library at a glance."""

from collections import Counter
from dataclasses import dataclass

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import SIMULATION


@dataclass(frozen=True, kw_only=True)
class SourceSummary:
    """The rows of a source that is not the simulation.

    Attributes:
        source: Who made them.
        reaches: Number of rows.
        successes: How many of them reached their goal.
        weights: How many simulated reaches a row counts as: the different values, sorted.
    """

    source: str
    reaches: int
    successes: int
    weights: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LibrarySummary:
    """What a library holds; all numbers but `shards` and `added` are of simulated reaches.

    Attributes:
        category: Clutter category.
        robot: Robot.
        scenario: Digest of the scenario.
        shards: Number of Parquet files.
        reaches: Number of rows.
        streams: Seed streams of the environments, sorted.
        environments: Number of different environments.
        goals: Number of different goals.
        starts: Number of different places and directions of the hand at the start.
        successes: Number of reaches that arrived at their goal.
        success_rate: Their share; NaN without any reach.
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
    shards: int
    reaches: int
    streams: tuple[str, ...]
    environments: int
    goals: int
    starts: int
    successes: int
    success_rate: float
    success_interval: tuple[float, float]
    outcomes: dict[str, int]
    simulated_s: float
    wall_time_s: float
    lic_drake_versions: tuple[str, ...]
    drake_versions: tuple[str, ...]
    added: tuple[SourceSummary, ...]


def summarize(library: ExperienceLibrary) -> LibrarySummary:
    """Reads a library and returns its numbers.

    Raises:
        LibraryError: There is no library, it is empty, or it cannot be read.
    """
    header, columns = library.scenario(), library.columns()
    of_source = {
        source: {name: values[columns["source"] == source] for name, values in columns.items()}
        for source in sorted({SIMULATION, *columns["source"]})
    }
    simulated = of_source.pop(SIMULATION)
    reaches, successes = len(simulated["key"]), int(simulated["success"].sum())

    def different(*names: str) -> int:
        return len(set(zip(*(simulated[name] for name in names), strict=True)))

    return LibrarySummary(
        category=header.category,
        robot=header.robot,
        scenario=header.digest,
        shards=len(library.shard_paths()),
        reaches=reaches,
        streams=tuple(sorted(set(simulated["stream"]))),
        environments=different("stream", "environment"),
        goals=different("goal_x", "goal_y", "goal_z"),
        starts=different("start_x", "start_y", "start_z", "start_phi"),
        successes=successes,
        success_rate=successes / reaches if reaches else float("nan"),
        success_interval=wilson_interval(successes, reaches),
        outcomes=dict(Counter(map(str, simulated["outcome"])).most_common()),
        simulated_s=float(simulated["duration_s"].sum()),
        wall_time_s=float(simulated["wall_time_s"].sum()),
        lic_drake_versions=tuple(sorted(set(simulated["lic_drake_version"]))),
        drake_versions=tuple(sorted(set(simulated["drake_version"]))),
        added=tuple(
            SourceSummary(
                source=source,
                reaches=len(rows["key"]),
                successes=int(rows["success"].sum()),
                weights=tuple(sorted(set(rows["weight"].tolist()))),
            )
            for source, rows in of_source.items()
        ),
    )
