"""Checks a library: what is there, what its request still lacks, and what is damaged."""

from collections import Counter
from dataclasses import dataclass

from lic_drake.errors import LibraryError
from lic_drake.experience.added import FOLDER, addition_paths, read_addition
from lic_drake.experience.grid import CollectionRequest
from lic_drake.experience.journal import journal_paths, read_journal
from lic_drake.experience.schema import read_header, read_table
from lic_drake.experience.store import ExperienceLibrary


@dataclass(frozen=True, kw_only=True)
class DamagedFile:
    """A file that cannot be read.

    Attributes:
        name: Its name in the library's folder.
        reason: One line.
    """

    name: str
    reason: str


@dataclass(frozen=True, kw_only=True)
class LibraryReport:
    """What `check_library` found.

    Attributes:
        shards: Number of Parquet files.
        reaches: Number of rows in the readable ones.
        journalled: Number of finished reaches of interrupted tasks, not yet in a shard.
        added: Number of readable records that were added from elsewhere.
        damaged: Parquet files that cannot be read, those of added records included.
        lost_lines: Number of damaged lines in journals; their reaches will be simulated again.
        scenarios: Digests of the scenarios in the library; more than one is an error.
        duplicates: Keys of reaches that the library holds more than once, sorted.
        requested: Number of reaches of the request; None without a request.
        missing: Number of reaches of the request that no shard holds; None without a request.
        incomplete: Indices of the environments of the request that lack reaches.
    """

    shards: int
    reaches: int
    journalled: int
    added: int
    damaged: tuple[DamagedFile, ...]
    lost_lines: int
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
        LibraryError: There is no library, or a journal may not be read.
    """
    paths = library.shard_paths()
    damaged: list[DamagedFile] = []
    scenarios: set[str] = set()
    keys: Counter[str] = Counter()
    for path in paths:
        try:
            keys.update(read_table(path).column("key").to_pylist())
            scenarios.add(read_header(path).scenario_digest)
        except LibraryError as error:
            damaged.append(DamagedFile(name=path.name, reason=str(error)))
    added = 0
    for path in addition_paths(library):
        try:
            added += read_addition(path).records
        except LibraryError as error:
            damaged.append(DamagedFile(name=f"{FOLDER}/{path.name}", reason=str(error)))
    journals = [read_journal(path) for path in journal_paths(library.path)]
    journalled = {record.key for records, _ in journals for record in records} - keys.keys()
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
        journalled=len(journalled),
        added=added,
        damaged=tuple(damaged),
        lost_lines=sum(count for _, count in journals),
        scenarios=tuple(sorted(scenarios)),
        duplicates=tuple(sorted(key for key, count in keys.items() if count > 1)),
        requested=None if request is None else requested,
        missing=None if request is None else sum(lacking.values()),
        incomplete=tuple(lacking),
    )
