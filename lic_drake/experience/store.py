"""`ExperienceLibrary`: the library D of the paper (III-A) as a folder of Parquet shards."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
from numpy.typing import NDArray

from lic_drake.errors import LibraryError, quoted
from lic_drake.experience.files import readable_errors, write_atomically
from lic_drake.experience.schema import (
    TableHeader,
    make_header,
    read_header,
    read_table,
    to_records,
    to_table,
    write_table,
)
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario, parse_scenario

SUFFIX = ".parquet"
"""End of a shard's file name."""

COMPACTED = "reaches"
"""Name of the shard that holds all rows after `ExperienceLibrary.compact`."""


class ExperienceLibrary:
    """Reaches of one scenario: a folder of shards, or a single Parquet file.

    Opening reads nothing; every call looks at the files as they are then. The folder also opens
    with `pandas.read_parquet`. Shards are only ever added or replaced as a whole.

    Attributes:
        path: The folder or file.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def shard_paths(self) -> list[Path]:
        """Returns the library's Parquet files, sorted by name.

        Raises:
            LibraryError: There is no such folder or file, or it may not be read.
        """
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

    @property
    def num_reaches(self) -> int:
        """Number of rows, read from the shards' footers."""
        return sum(len(read_table(path, [])) for path in self.shard_paths())

    def keys(self) -> set[str]:
        """Returns the request keys of all reaches in the library."""
        return {
            key
            for path in self.shard_paths()
            for key in read_table(path, ["key"]).column("key").to_pylist()
        }

    def header(self) -> TableHeader:
        """Returns the metadata of the shards, which must agree on the scenario.

        Raises:
            LibraryError: The library is empty or unreadable, or holds more than one scenario.
        """
        paths = self.shard_paths()
        if not paths:
            raise LibraryError(
                f"{self.path} holds no reaches yet; add some with: lic collect {self.path}"
            )
        headers = [read_header(path) for path in paths]
        for path, header in zip(paths, headers, strict=True):
            if header.scenario_digest != headers[0].scenario_digest:
                raise LibraryError(
                    f"{paths[0]} and {path} hold different scenarios"
                    f" ({headers[0].scenario_digest} and {header.scenario_digest});"
                    " keep one library per scenario"
                )
        return headers[0]

    def scenario(self) -> Scenario:
        """Returns the scenario that the reaches were simulated with.

        Raises:
            LibraryError: As `header`.
            ScenarioError: This lic_drake does not know the scenario's category or parameters.
        """
        header = self.header()
        scenario = parse_scenario(header.scenario, source=str(self.path))
        if scenario.digest != header.scenario_digest:
            raise LibraryError(
                f"{self.path}: its scenario has digest {scenario.digest}, its reaches were made"
                f" with {quoted(header.scenario_digest)}: the file was edited, or another lic_drake"
                " wrote it; use that lic_drake, or collect the library again"
            )
        return scenario

    def table(self) -> pa.Table:
        """Returns all rows, sorted by shard.

        Raises:
            LibraryError: As `header`.
        """
        self.header()
        tables = [read_table(path) for path in self.shard_paths()]
        return pa.concat_tables([table.replace_schema_metadata() for table in tables])

    def columns(self) -> dict[str, NDArray[Any]]:
        """Returns every column as an array of shape (n,), units as in `ReachRecord`.

        Text columns are object arrays of str; `q_start` and `q_final` are object arrays of
        arrays, because a reach that never began has no joint angles.

        Raises:
            LibraryError: As `header`.
        """
        table = self.table()
        return {name: table.column(name).to_numpy() for name in table.column_names}

    def records(self) -> list[ReachRecord]:
        """Returns every row as a record.

        Raises:
            LibraryError: As `header`.
        """
        return to_records(self.table())

    def shard_path(self, name: str) -> Path:
        """Returns the path of the shard with this name."""
        return self.path / f"{name}{SUFFIX}"

    def write_shard(self, name: str, records: Sequence[ReachRecord], scenario: Scenario) -> Path:
        """Writes a shard; it replaces one of the same name, as a whole or not at all.

        Args:
            name: File name without suffix; without a leading dot or underscore.
            records: The rows.
            scenario: The scenario of all records.

        Returns:
            The shard's path.

        Raises:
            LibraryError: The folder cannot be written (permission, disk full), or a record
                belongs to another scenario.
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
        table = to_table(records, header)
        self.create()
        path = self.shard_path(name)
        write_atomically(path, lambda temporary: write_table(table, temporary))
        return path

    def compact(self) -> None:
        """Writes all shards of a folder as one; a kill on the way loses nothing.

        Raises:
            LibraryError: As `header`, or the folder cannot be written.
        """
        paths = self.shard_paths()
        if len(paths) < 2 or self.path.is_file():
            return
        header = self.header()
        records = {record.key: record for record in self.records()}
        rows = sorted(records.values(), key=lambda r: (r.stream, r.environment, r.key))
        whole = self.shard_path(COMPACTED)
        write_atomically(whole, lambda temporary: write_table(to_table(rows, header), temporary))
        with readable_errors(self.path, "delete the old shards of"):
            for path in paths:
                if path != whole:
                    path.unlink()

    def create(self) -> None:
        """Makes the folder if it is not there.

        Raises:
            LibraryError: The path is a file, or the folder cannot be made.
        """
        with readable_errors(self.path, "create the folder"):
            self.path.mkdir(parents=True, exist_ok=True)
