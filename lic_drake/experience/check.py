"""Checks of a library: what it lacks, what is damaged, and whether its rows come out again."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from lic_drake.errors import LibraryError
from lic_drake.experience.collect import CollectionRequest
from lic_drake.experience.runner import ReachFunction
from lic_drake.experience.schema import read_header, read_table
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import SIMULATION, ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

NOT_COMPARED = ("wall_time_s", "lic_drake_version", "drake_version", "weight")
"""What a repetition may change without being another reach."""


@dataclass(frozen=True, kw_only=True)
class LibraryReport:
    """What `check_library` found.

    Attributes:
        shards: Number of Parquet files.
        reaches: Number of rows in the readable ones.
        damaged: Names of Parquet files that cannot be read, and why, in a line.
        scenarios: Digests of the scenarios in the library; more than one is an error.
        duplicates: Keys of reaches that the library holds more than once, sorted.
        requested: Number of reaches of the request; None without a request.
        missing: Number of reaches of the request that no shard holds; None without a request.
        incomplete: Indices of the environments of the request that lack reaches.
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
        """Whether the library is whole, without contradictions and complete."""
        return (
            not self.damaged
            and not self.duplicates
            and len(self.scenarios) <= 1
            and not self.missing
        )


def check_library(
    library: ExperienceLibrary, request: CollectionRequest | None = None
) -> LibraryReport:
    """Reads every file of a library in full and reports what is wrong with it.

    Args:
        library: The library.
        request: What it should hold; None leaves completeness open.

    Raises:
        LibraryError: There is no library.
    """
    paths = library.shard_paths()
    damaged: dict[str, str] = {}
    scenarios: set[str] = set()
    keys: Counter[str] = Counter()
    for path in paths:
        try:
            keys.update(read_table(path).column("key").to_pylist())
            scenarios.add(read_header(path).scenario_digest)
        except LibraryError as error:
            damaged[path.name] = str(error)
    lacking: dict[int, int] = {}
    requested = 0
    if request is not None:
        for environment in request.environment_indices:
            wanted = [item.key for item in request.reaches(environment)]
            requested += len(wanted)
            if missing := sum(key not in keys for key in wanted):
                lacking[environment] = missing
    return LibraryReport(
        shards=len(paths),
        reaches=keys.total(),
        damaged=damaged,
        scenarios=tuple(sorted(scenarios)),
        duplicates=tuple(sorted(key for key, count in keys.items() if count > 1)),
        requested=None if request is None else requested,
        missing=None if request is None else sum(lacking.values()),
        incomplete=tuple(lacking),
    )


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A row that came out otherwise.

    Attributes:
        key: Its key.
        fields: Names of the fields that differ in any bit.
        outcomes: Outcome in the library, and of the repetition.
    """

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
    """Simulates random simulated rows of a library again: a record is a function of its request.

    Equality to the last bit may be asked for on the machine that collected the library: other
    processors round otherwise, and contact makes much of little.

    Args:
        library: The library.
        count: Number of rows to draw without replacement; all of them if there are fewer.
        rng: Draws them.
        reach: Simulates a request.
        progress: Is called after each row with the number of rows done and in all.

    Returns:
        The rows that differ, environment by environment.

    Raises:
        LibraryError: The library is empty, or cannot be read.
    """
    scenario = library.scenario()
    rows = [row for row in library.records() if row.source == SIMULATION]
    drawn = [rows[i] for i in rng.choice(len(rows), min(count, len(rows)), replace=False)]
    # An environment's diagrams are built once.
    drawn.sort(key=lambda row: (row.stream, row.environment))
    differing: list[Difference] = []
    for done, row in enumerate(drawn, start=1):
        again = reach(ReachRequest.from_record(row, scenario))
        names = [f.name for f in fields(ReachRecord) if f.name not in NOT_COMPARED]
        if others := tuple(n for n in names if not _is_same(getattr(row, n), getattr(again, n))):
            outcomes = (row.outcome, again.outcome)
            differing.append(Difference(key=row.key, fields=others, outcomes=outcomes))
        progress(done, len(drawn))
    return differing


def _is_same(a: object, b: object) -> bool:
    """Returns whether two values are equal; NaN equals itself."""
    both_nan = isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    return both_nan or a == b
