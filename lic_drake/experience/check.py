"""Reports on a library: its contents, its faults, and whether its rows can be reproduced."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from lic_drake.errors import LibraryError
from lic_drake.experience.collect import CollectionRequest
from lic_drake.experience.runner import ReachFunction
from lic_drake.experience.schema import read_shard
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import SIMULATION, ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

NOT_COMPARED = ("wall_time_s", "lic_drake_version", "drake_version", "weight")
"""Fields that `recompute` ignores."""


@dataclass(frozen=True, kw_only=True)
class LibraryReport:
    """Result of `check_library`; the last three fields concern its request.

    Attributes:
        shards: Number of Parquet files.
        reaches: Number of rows in the readable ones.
        damaged: Names of unreadable Parquet files, with the reason in one line.
        scenarios: Digests of the scenarios in the library; more than one is an error.
        duplicates: Keys of reaches that occur more than once, sorted.
        requested: Number of requested reaches; None without a request, as `missing`.
        missing: Number of requested reaches that no shard holds.
        incomplete: Indices of the environments that lack reaches.
    """

    shards: int
    reaches: int
    damaged: dict[str, str]
    scenarios: tuple[str, ...]
    duplicates: tuple[str, ...]
    requested: int | None
    missing: int | None
    incomplete: tuple[int, ...]

    @property
    def is_sound(self) -> bool:
        """Whether the library is readable, complete, and free of duplicates and mixed scenarios."""
        faults = self.damaged or self.duplicates or self.missing
        return not faults and len(self.scenarios) <= 1


def check_library(
    library: ExperienceLibrary, request: CollectionRequest | None = None
) -> LibraryReport:
    """Reads every file of a library in full and reports all faults.

    Args:
        library: The library.
        request: Its intended contents; None skips the completeness check.

    Raises:
        LibraryError: There is no library.
    """
    paths = library.shard_paths()
    damaged: dict[str, str] = {}
    scenarios: set[str] = set()
    keys: Counter[str] = Counter()
    for path in paths:
        try:
            header, table = read_shard(path)
        except LibraryError as error:
            damaged[path.name] = str(error)
            continue
        keys.update(table.column("key").to_pylist())
        scenarios.add(header.scenario_digest)
    lacking: Counter[int] = Counter()
    requested = 0
    for reach in request.all_reaches() if request is not None else ():
        requested += 1
        if reach.key not in keys:
            lacking[reach.environment] += 1
    return LibraryReport(
        shards=len(paths),
        reaches=keys.total(),
        damaged=damaged,
        scenarios=tuple(sorted(scenarios)),
        duplicates=tuple(sorted(key for key, count in keys.items() if count > 1)),
        requested=None if request is None else requested,
        missing=None if request is None else lacking.total(),
        incomplete=tuple(lacking),
    )


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A row that was not reproduced: fields that differ in any bit, old and new outcome."""

    key: str
    fields: tuple[str, ...]
    outcomes: tuple[str, str]


def recompute(
    library: ExperienceLibrary,
    count: int,
    rng: np.random.Generator,
    *,
    reach: ReachFunction = run_reach,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Difference]:
    """Simulates randomly drawn simulated rows again and compares them bit for bit.

    Bitwise equality can only be expected on the machine that collected the library: other
    processors round differently, and contact amplifies small differences.

    Args:
        library: The library.
        count: Number of rows to draw without replacement; all of them if there are fewer.
        rng: Draws the rows.
        reach: Simulates a request.
        progress: Called after each row with the number of rows done and the total.

    Returns:
        The rows that differ, grouped by environment.

    Raises:
        LibraryError: The library is empty or cannot be read.
    """
    scenario = library.scenario()
    rows = [row for row in library.records() if row.source == SIMULATION]
    drawn = [rows[i] for i in rng.choice(len(rows), min(count, len(rows)), replace=False)]
    # Diagrams are cached per environment.
    drawn.sort(key=lambda row: (row.stream, row.environment))
    names = [item.name for item in fields(ReachRecord) if item.name not in NOT_COMPARED]
    differing: list[Difference] = []
    for done, row in enumerate(drawn, start=1):
        again = reach(ReachRequest.from_record(row, scenario))
        # As text, so that NaN equals NaN.
        if others := tuple(n for n in names if repr(getattr(row, n)) != repr(getattr(again, n))):
            outcomes = (row.outcome, again.outcome)
            differing.append(Difference(key=row.key, fields=others, outcomes=outcomes))
        progress(done, len(drawn))
    return differing


@dataclass(frozen=True, kw_only=True)
class SourceSummary:
    """The rows of one source other than simulation; `weights` are its distinct ones, sorted."""

    source: str
    reaches: int
    successes: int
    weights: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class LibrarySummary:
    """Contents of a library. All but `shards` and `added` describe its simulated reaches.

    Attributes:
        scenario: Digest of the scenario.
        environments: Number of distinct environments; likewise `goals` and `starts` (hand poses).
        success_rate: Fraction of successes; NaN without any reach.
        success_interval: Wilson 90 % interval of the success rate.
        outcomes: Outcome -> number of reaches, most frequent first.
        simulated_s: Total simulated time, seconds.
        wall_time_s: Total wall time, seconds.
        added: Rows of other sources, by source.
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
    """Summarizes a library.

    Raises:
        LibraryError: There is no library, it is empty, or it cannot be read.
    """
    scenario, columns = library.scenario(), library.columns()
    by_source = {
        source: {name: values[columns["source"] == source] for name, values in columns.items()}
        for source in sorted({SIMULATION, *columns["source"]})
    }
    simulated = by_source.pop(SIMULATION)
    reaches, successes = len(simulated["key"]), int(simulated["success"].sum())

    def count_distinct(*names: str) -> int:
        return len(set(zip(*(simulated[name] for name in names), strict=True)))

    def distinct(name: str) -> tuple[str, ...]:
        return tuple(sorted(set(simulated[name])))

    return LibrarySummary(
        category=scenario.category,
        robot=scenario.robot,
        scenario=scenario.digest,
        shards=len(library.shard_paths()),
        reaches=reaches,
        streams=distinct("stream"),
        environments=count_distinct("stream", "environment"),
        goals=count_distinct("goal_x", "goal_y", "goal_z"),
        starts=count_distinct("start_x", "start_y", "start_z", "start_phi"),
        successes=successes,
        success_rate=successes / reaches if reaches else float("nan"),
        success_interval=wilson_interval(successes, reaches),
        outcomes=dict(Counter(map(str, simulated["outcome"])).most_common()),
        simulated_s=float(simulated["duration_s"].sum()),
        wall_time_s=float(simulated["wall_time_s"].sum()),
        lic_drake_versions=distinct("lic_drake_version"),
        drake_versions=distinct("drake_version"),
        added=tuple(
            SourceSummary(
                source=source,
                reaches=len(rows["key"]),
                successes=int(rows["success"].sum()),
                weights=tuple(sorted(set(rows["weight"].tolist()))),
            )
            for source, rows in by_source.items()
        ),
    )
