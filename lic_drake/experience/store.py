"""`ExperienceLibrary`: the library D of the paper (III-A) as a folder of Parquet shards."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from lic_drake.errors import LibraryError, quoted, readable_errors
from lic_drake.experience.schema import (
    read_shard,
    to_records,
    to_table,
    write_atomically,
    write_table,
)
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario, parse_scenario

SUFFIX = ".parquet"
"""Suffix of shards."""


class ExperienceLibrary:
    """Reaches of one scenario: a folder of shards, or a single Parquet file.

    Nothing is cached: each call reads the current files, and raises a LibraryError if there are
    none, one is damaged, or they hold different scenarios. `pandas.read_parquet` opens the list of
    `shard_paths`. Shards are only added or replaced as a whole.

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
            # glob would hide that the folder cannot be read.
            paths = sorted(self.path.iterdir())
        return [p for p in paths if p.suffix == SUFFIX and not p.name.startswith((".", "_"))]

    def _read(self, columns: list[str] | None) -> tuple[dict[str, str], list[pa.Table]]:
        """Reads all shards, which must agree on the scenario; returns the header of the first."""
        paths = self.shard_paths()
        shards = [read_shard(path, columns) for path in paths]
        if not any(len(table) for _, table in shards):
            raise LibraryError(
                f"{self.path} holds no reaches yet; add some with: lic collect {self.path}"
            )
        headers, tables = zip(*shards, strict=True)
        first = headers[0]["scenario_digest"]
        for path, header in zip(paths, headers, strict=True):
            if (digest := header["scenario_digest"]) != first:
                raise LibraryError(
                    f"{paths[0]} and {path} hold different scenarios ({first} and {digest});"
                    " keep one library per scenario"
                )
        return headers[0], list(tables)

    @property
    def num_reaches(self) -> int:
        """Number of rows, read from the shards' footers."""
        return sum(map(len, self._read([])[1]))

    def successes(self) -> dict[str, bool]:
        """Returns the key of every reach, and whether it succeeded; an empty folder has none."""
        found: dict[str, bool] = {}
        for table in self._read(["key", "success"])[1] if self.shard_paths() else []:
            found.update(zip(*(column.to_pylist() for column in table.columns), strict=True))
        return found

    def scenario(self, overrides: str = "") -> Scenario:
        """Returns the scenario of the reaches, with values of YAML text put over it.

        Raises:
            ScenarioError: It is unknown here, or the text has an unknown or invalid value.
        """
        header = self._read([])[0]
        stored = parse_same_scenario(header["scenario"], header["scenario_digest"], self.path)
        return parse_scenario(header["scenario"], overrides, "--set") if overrides else stored

    def check_scenario(self, scenario: Scenario, owner: str) -> None:
        """Raises a LibraryError if the library holds reaches of another scenario."""
        held = self._read([])[0]["scenario_digest"] if self.shard_paths() else scenario.digest
        if held != scenario.digest:
            raise LibraryError(
                f"{self.path} holds reaches of scenario {held}, but {owner} is of scenario"
                f" {scenario.digest}; keep one library per scenario"
            )

    def table(self) -> pa.Table:
        """Returns all rows, sorted by shard."""
        return pa.concat_tables(table.replace_schema_metadata() for table in self._read(None)[1])

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
        """Writes records of a scenario to a new or replaced shard, atomically; returns its path."""
        for other in {record.scenario for record in records} - {scenario.digest}:
            raise LibraryError(
                f"shard {name}: records of scenario {other} do not belong to"
                f" scenario {scenario.digest}"
            )
        self.create()
        path, table = self.shard_path(name), to_table(records, scenario)
        write_atomically(path, lambda temporary: write_table(table, temporary))
        return path

    def add_to_shard(self, name: str, records: Sequence[ReachRecord], scenario: Scenario) -> None:
        """Adds the records that a shard lacks; it is replaced atomically."""
        path = self.shard_path(name)
        held = to_records(read_shard(path)[1]) if path.exists() else []
        keys = {record.key for record in held}
        self.write_shard(name, [*held, *(r for r in records if r.key not in keys)], scenario)

    def compact(self) -> None:
        """Merges all shards of a folder into one, `reaches`; loses nothing if killed."""
        paths = self.shard_paths()
        if len(paths) < 2:
            return
        records = {record.key: record for record in self.records()}
        rows = sorted(records.values(), key=lambda r: (r.stream, r.environment, r.key))
        whole = self.write_shard("reaches", rows, self.scenario())
        with readable_errors(self.path, "delete the old shards of"):
            for path in paths:
                if path != whole:
                    path.unlink()

    @contextmanager
    def locked(self, share: str = "1/1") -> Iterator[None]:
        """Locks the library against writers other than those of other shares k/n with the same n.

        The operating system releases the lock when the process ends, even if it is killed.
        """
        index, _, count = share.partition("/")
        path = self.path / f"_collecting-{index}-of-{count}.lock"
        lock = FileLock(path, timeout=0)
        with readable_errors(path, "lock"):
            try:
                lock.acquire()
                locks = self.path.glob("_collecting-*.lock")
                for other in (p for p in locks if not p.name.endswith(f"-of-{count}.lock")):
                    # Another process may hold it briefly, just to test it.
                    with FileLock(other, timeout=1.0):
                        pass
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


def parse_same_scenario(text: str, digest: str, path: Path) -> Scenario:
    """Parses the scenario in a file; raises a LibraryError if it has not the digest given there."""
    scenario = parse_scenario(text, source=str(path))
    if scenario.digest != digest:
        raise LibraryError(
            f"{path}: its scenario has digest {scenario.digest}, but its reaches have"
            f" {quoted(digest)}: it was edited or written by another lic_drake; use that"
            " lic_drake, or collect the library again"
        )
    return scenario


def merge_libraries(sources: Sequence[ExperienceLibrary], output: Path) -> int:
    """Merges libraries of one scenario into a new .parquet file; returns its number of rows.

    Equal rows are written once, different ones of a reach refused; sorted by environment, stably.
    """
    if output.suffix != SUFFIX or output.exists():
        raise LibraryError(
            f"{output} exists, or does not end in {SUFFIX}; delete it or choose another name"
        )
    scenario = sources[0].scenario()
    merged: dict[str, ReachRecord] = {}
    for source in sources:
        source.check_scenario(scenario, str(sources[0].path))
        for record in source.records():
            earlier = merged.setdefault(record.key, record)
            # As text, so that NaN equals NaN; wall times may differ.
            if repr(replace(record, wall_time_s=earlier.wall_time_s)) != repr(earlier):
                raise LibraryError(
                    f"{source.path} holds another result of reach {record.key} than an earlier"
                    " library; find out which one is right before merging"
                )
    rows = sorted(merged.values(), key=lambda record: (record.stream, record.environment))
    ExperienceLibrary(output.parent).write_shard(output.stem, rows, scenario)
    return len(rows)
