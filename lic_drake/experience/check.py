"""Checks a library: damaged files, duplicate reaches, and what its request still lacks."""

from collections import Counter
from dataclasses import dataclass

from lic_drake.errors import LibraryError
from lic_drake.experience.grid import CollectionRequest
from lic_drake.experience.journal import unfinished_reaches
from lic_drake.experience.schema import read_header, read_table
from lic_drake.experience.store import ExperienceLibrary


@dataclass(frozen=True, kw_only=True)
class LibraryReport:
    """What `check_library` found.

    Attributes:
        shards: Number of Parquet files.
        reaches: Number of rows in the readable ones.
        journalled: Number of finished reaches of interrupted tasks, not yet in a shard.
        damaged: One line per file that cannot be read.
        scenarios: Digests of the scenarios in the library; more than one is an error.
        duplicates: Keys of reaches that the library holds more than once, sorted.
        missing: Number of reaches of the request that no shard holds; None without a request.
    """

    shards: int
    reaches: int
    journalled: int
    damaged: tuple[str, ...]
    scenarios: tuple[str, ...]
    duplicates: tuple[str, ...]
    missing: int | None

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
    damaged: list[str] = []
    scenarios: list[str] = []
    keys: Counter[str] = Counter()
    for path in paths:
        try:
            keys.update(read_table(path).column("key").to_pylist())
            scenarios.append(read_header(path).scenario_digest)
        except LibraryError as error:
            damaged.append(str(error))
    missing = None
    if request is not None:
        missing = sum(
            item.key not in keys
            for environment in request.environment_indices
            for item in request.reaches(environment)
        )
    return LibraryReport(
        shards=len(paths),
        reaches=keys.total(),
        journalled=unfinished_reaches(library.path),
        damaged=tuple(damaged),
        scenarios=tuple(sorted(set(scenarios))),
        duplicates=tuple(sorted(key for key, count in keys.items() if count > 1)),
        missing=missing,
    )
