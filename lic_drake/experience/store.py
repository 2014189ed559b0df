"""`ExperienceLibrary`: the library D of the paper (III-A) as a folder of Parquet shards."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import pyarrow as pa
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from lic_drake.errors import LibraryError, RequestError, quoted
from lic_drake.experience.files import readable_errors, write_atomically
from lic_drake.experience.schema import (
    TableHeader,
    make_header,
    read_shard,
    to_records,
    to_table,
    write_table,
)
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario, parse_scenario

SUFFIX = ".parquet"
"""Suffix of shards."""

COMPACTED = "reaches"
"""Name of the shard that `ExperienceLibrary.compact` writes."""

PATIENCE_S = 1.0
"""Another process may hold a lock briefly, just to test it; wait this long, seconds."""


@dataclass(frozen=True)
class Share:
    """One of `count` parts of a collection, for job arrays: every count-th environment.

    Attributes:
        index: Number of this part, 1 to `count`.
        count: Number of parts.

    Raises:
        RequestError: The index is out of range.
    """

    index: int = 1
    count: int = 1

    def __post_init__(self) -> None:
        if not 1 <= self.index <= self.count:
            raise RequestError(f"a share is k/n with k from 1 to n, for instance 3/20, got {self}")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parses "k/n"; raises a RequestError if that fails."""
        numbers = re.fullmatch(r"(\d+)/(\d+)", text)
        if numbers is None:
            raise RequestError(
                f"a share is k/n with k from 1 to n, for instance 3/20, got {quoted(text)}"
            )
        return cls(*map(int, numbers.groups()))

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"

    def of(self, environments: range) -> range:
        """Returns this share of the environments of a collection."""
        return environments[self.index - 1 :: self.count]


WHOLE = Share()
"""The whole collection as one share."""


class ExperienceLibrary:
    """Reaches of one scenario: a folder of shards, or a single Parquet file.

    Nothing is cached: each call reads the current files, and raises a LibraryError if there are
    none, one is damaged, or they hold different scenarios. `pandas.read_parquet` also opens the
    folder. Shards are only added or replaced as a whole.

    Attributes:
        path: The folder or file.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def shard_paths(self) -> list[Path]:
        """Returns the library's Parquet files, sorted by name."""
        with readable_errors(self.path, "read"):
            if self.path.is_file():
                return [self.path]
            if not self.path.is_dir():
                raise LibraryError(
                    f"no experience library at {self.path}; make one with: lic collect {self.path}"
                )
            return sorted(
                path
                for path in self.path.iterdir()
                if path.suffix == SUFFIX and not path.name.startswith((".", "_"))
            )

    def _read(self, columns: list[str] | None) -> list[tuple[TableHeader, pa.Table]]:
        """Reads all shards, which must agree on the scenario."""
        paths = self.shard_paths()
        shards = [read_shard(path, columns) for path in paths]
        for path, (header, _) in zip(paths, shards, strict=True):
            if header.scenario_digest != shards[0][0].scenario_digest:
                raise LibraryError(
                    f"{paths[0]} and {path} hold different scenarios"
                    f" ({shards[0][0].scenario_digest} and {header.scenario_digest});"
                    " keep one library per scenario"
                )
        return shards

    @property
    def num_reaches(self) -> int:
        """Number of rows, read from the shards' footers."""
        return sum(len(table) for _, table in self._read([]))

    def successes(self) -> dict[str, bool]:
        """Returns the key of every reach, and whether it succeeded."""
        found: dict[str, bool] = {}
        for _, table in self._read(["key", "success"]):
            found.update(zip(*(column.to_pylist() for column in table.columns), strict=True))
        return found

    def header(self) -> TableHeader:
        """Returns the metadata of the shards."""
        shards = self._read([])
        if not shards:
            raise LibraryError(
                f"{self.path} holds no reaches yet; add some with: lic collect {self.path}"
            )
        return shards[0][0]

    def scenario(self) -> Scenario:
        """Returns the scenario of the reaches.

        Raises:
            ScenarioError: This lic_drake does not know the scenario's category or parameters.
        """
        header = self.header()
        scenario = parse_scenario(header.scenario, source=str(self.path))
        if scenario.digest != header.scenario_digest:
            raise LibraryError(
                f"{self.path}: its scenario has digest {scenario.digest}, but its reaches have"
                f" {quoted(header.scenario_digest)}: it was edited or written by another lic_drake;"
                " use that lic_drake, or collect the library again"
            )
        return scenario

    def table(self) -> pa.Table:
        """Returns all rows, sorted by shard."""
        self.header()
        return pa.concat_tables([table.replace_schema_metadata() for _, table in self._read(None)])

    def columns(self) -> dict[str, NDArray[Any]]:
        """Returns every column as an array of shape (n,), units as in `ReachRecord`.

        Text columns are object arrays of str; `q_start` and `q_final` are object arrays of arrays.
        """
        table = self.table()
        return {name: table.column(name).to_numpy() for name in table.column_names}

    def records(self) -> list[ReachRecord]:
        """Returns every row as a record."""
        return to_records(self.table())

    def shard_path(self, name: str) -> Path:
        """Returns the path of the shard with this name."""
        return self.path / f"{name}{SUFFIX}"

    def write_shard(self, name: str, records: Sequence[ReachRecord], scenario: Scenario) -> Path:
        """Writes records of a scenario to a new or replaced shard, atomically; returns its path.

        Raises:
            LibraryError: The folder cannot be written (permission, disk full), the name is not a
                plain file name, or a record belongs to another scenario.
        """
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,200}", name):
            raise LibraryError(f"{name!r} cannot be a shard's name; use letters and digits")
        header = make_header(scenario)
        others = {record.scenario for record in records} - {header.scenario_digest}
        if others:
            raise LibraryError(
                f"shard {name}: records of scenario {sorted(others)[0]} do not belong to"
                f" scenario {header.scenario_digest}"
            )
        self.create()
        _write_records(self.shard_path(name), records, header)
        return self.shard_path(name)

    def compact(self) -> None:
        """Merges all shards of a folder into one; loses nothing if killed."""
        paths = self.shard_paths()
        if len(paths) < 2 or self.path.is_file():
            return
        header = self.header()
        records = {record.key: record for record in self.records()}
        rows = sorted(records.values(), key=lambda r: (r.stream, r.environment, r.key))
        whole = self.shard_path(COMPACTED)
        _write_records(whole, rows, header)
        with readable_errors(self.path, "delete the old shards of"):
            for path in paths:
                if path != whole:
                    path.unlink()

    @contextmanager
    def locked(self, share: Share = WHOLE) -> Iterator[None]:
        """Locks the library against writers other than those of the other shares of a collection.

        The operating system releases the lock when the process ends, even if it is killed.

        Raises:
            LibraryError: Another process is adding to it, or the folder cannot be written.
        """
        path = self.path / f"_collecting-{share.index}-of-{share.count}.lock"
        division = f"-of-{share.count}.lock"
        others = [p for p in self.path.glob("_collecting-*.lock") if not p.name.endswith(division)]
        lock = FileLock(path, timeout=0)
        with readable_errors(path, "lock"):
            try:
                lock.acquire()
                for other in others:
                    FileLock(other, timeout=PATIENCE_S).acquire().lock.release()
            except Timeout as error:
                lock.release()
                raise LibraryError(
                    f"another process is adding to {self.path} (it holds {error.lock_file}); wait"
                    " for it or stop it, or give each collection a --share of its own"
                ) from None
        with lock:
            lock.release()  # The context manager has acquired it a second time.
            yield

    def create(self) -> None:
        """Creates the folder if it does not exist."""
        with readable_errors(self.path, "create the folder"):
            self.path.mkdir(parents=True, exist_ok=True)


def merge_libraries(sources: Sequence[ExperienceLibrary], output: Path) -> int:
    """Merges libraries of one scenario into a new file, and returns its number of rows.

    Identical rows are written once. Rows are sorted by environment, stably.

    Args:
        sources: One or more libraries.
        output: A .parquet file that does not exist yet.

    Raises:
        LibraryError: The scenarios differ, two libraries hold different results of a reach, or a
            file cannot be read or written.
    """
    if output.suffix != SUFFIX:
        raise LibraryError(f"the merged file needs the suffix {SUFFIX}, got {output}")
    if os.path.exists(output):
        raise LibraryError(f"{output} exists; delete it or choose another name")
    header = sources[0].header()
    merged: dict[str, ReachRecord] = {}
    for source in sources:
        if (digest := source.header().scenario_digest) != header.scenario_digest:
            raise LibraryError(
                f"{source.path} holds scenario {digest}, but {sources[0].path} holds"
                f" {header.scenario_digest}; merge libraries of one scenario only"
            )
        for record in source.records():
            earlier = merged.setdefault(record.key, record)
            # As text, so that NaN equals NaN; wall times may differ.
            if repr(replace(record, wall_time_s=earlier.wall_time_s)) != repr(earlier):
                raise LibraryError(
                    f"{source.path} holds another result of reach {record.key} than an earlier"
                    " library; find out which one is right before merging"
                )
    rows = sorted(merged.values(), key=lambda record: (record.stream, record.environment))
    with readable_errors(output.parent, "create the folder"):
        output.parent.mkdir(parents=True, exist_ok=True)
    _write_records(output, rows, header)
    return len(rows)


def _write_records(path: Path, records: Sequence[ReachRecord], header: TableHeader) -> None:
    table = to_table(records, header)
    write_atomically(path, lambda temporary: write_table(table, temporary))
