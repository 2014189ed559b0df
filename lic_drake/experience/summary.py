"""The numbers that describe a library at a glance."""

from collections import Counter
from dataclasses import dataclass

from lic_drake.experience.added import Addition, additions
from lic_drake.experience.journal import unfinished_reaches
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval


@dataclass(frozen=True, kw_only=True)
class LibrarySummary:
    """What a library holds.

    Attributes:
        category: Clutter category.
        robot: Robot.
        scenario: Digest of the scenario.
        reaches: Number of rows.
        journalled: Number of finished reaches of interrupted tasks, not yet in a shard.
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
        added: Records of real or other simulated robots, which no other number here counts.
    """

    category: str
    robot: str
    scenario: str
    reaches: int
    journalled: int
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
    added: tuple[Addition, ...]

    @property
    def success_rate(self) -> float:
        """Share of reaches that arrived at their goal."""
        return self.successes / self.reaches


def summarize(library: ExperienceLibrary) -> LibrarySummary:
    """Reads a library and returns its numbers.

    Raises:
        LibraryError: There is no library, it is empty, or it cannot be read.
    """
    columns = library.columns()
    reaches = len(columns["key"])
    successes = int(columns["success"].sum())
    return LibrarySummary(
        category=str(columns["category"][0]),
        robot=str(columns["robot"][0]),
        scenario=str(columns["scenario"][0]),
        reaches=reaches,
        journalled=unfinished_reaches(library.path),
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
        added=additions(library),
    )
