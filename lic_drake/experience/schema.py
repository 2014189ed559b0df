"""The columns of an experience library, and Parquet files of rows.

The columns are the fields of `ReachRecord`, with unit and description as field metadata. The table
metadata (the header) holds the schema version, the version of lic_drake, and digest and YAML of
the scenario, so that every file is self-contained.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

import lic_drake
from lic_drake.errors import LibraryError, quoted, readable_errors
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario

SCHEMA_VERSION = 4
"""Incremented with every change of the columns or the metadata."""

_TYPES: dict[Any, pa.DataType] = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    tuple[float, ...]: pa.list_(pa.field("element", pa.float64(), nullable=False)),
}
_PREFIX = "lic_drake."
_HEADER = ("schema_version", "lic_drake_version", "scenario_digest", "scenario")


def schema_of(row: type[Any]) -> pa.Schema:
    """Returns the columns for a dataclass, with the metadata of its fields."""
    metadata = {item.name: {k: str(v) for k, v in item.metadata.items()} for item in fields(row)}
    return pa.schema(
        pa.field(item.name, _TYPES[item.type], nullable=False, metadata=metadata[item.name])
        for item in fields(row)
    )


SCHEMA = schema_of(ReachRecord)
"""The columns of a library, without the table metadata."""


def scenario_text(scenario: Scenario) -> str:
    """Returns a scenario as YAML that `parse_scenario` reads back."""
    return yaml.safe_dump(asdict(scenario), sort_keys=False)


def to_table(records: Sequence[ReachRecord], scenario: Scenario) -> pa.Table:
    """Returns records of a scenario as a table, one row each, in order."""
    values = (str(SCHEMA_VERSION), lic_drake.__version__, scenario.digest, scenario_text(scenario))
    header = {_PREFIX + name: value for name, value in zip(_HEADER, values, strict=True)}
    columns = {name: [getattr(record, name) for record in records] for name in SCHEMA.names}
    return pa.Table.from_pydict(columns, schema=SCHEMA.with_metadata(header))


def to_records(table: pa.Table) -> list[ReachRecord]:
    """Returns the rows of a table; floats are bitwise identical to those written."""
    lists = [field.name for field in SCHEMA if pa.types.is_list(field.type)]
    return [
        ReachRecord(**{**row, **{name: tuple(row[name]) for name in lists}})
        for row in table.to_pylist()
    ]


def write_table(table: pa.Table, path: Path) -> None:
    """Writes a table as a Parquet file with checksums."""
    # Dictionary encoding would merge NaNs with different payloads, so floats go without.
    texts = [field.name for field in table.schema if field.type == pa.string()]
    pq.write_table(table, path, compression="zstd", use_dictionary=texts, write_page_checksum=True)


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Writes a file so that readers see either the old or the new one, never a part.

    `write` writes the content to the path that it is given. If that fails, a LibraryError is
    raised and the folder is unchanged.
    """
    # The name is fixed so that the next writer overwrites what a killed one left behind. Parquet
    # readers skip names that begin with a dot or an underscore.
    temporary = path.with_name(f".{path.name}.tmp")
    with readable_errors(path, "write"):
        try:
            write(temporary)
            _sync(temporary)
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        _sync(path.parent)


def _sync(path: Path) -> None:
    """Flushes a file or directory entry to disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextmanager
def opened(path: Path, remedy: str) -> Iterator[pq.ParquetFile]:
    """Opens a Parquet file; errors become a `LibraryError`, with a remedy if it is damaged."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            yield file
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        # pyarrow also raises OSErrors for damaged files, but without an error number.
        number = getattr(error, "errno", None)
        if number is not None:
            raise LibraryError(f"cannot read {path}: {os.strerror(number)}") from None
        raise LibraryError(f"{path} is damaged or not a Parquet file; {remedy}") from error


def read_shard(path: Path, columns: list[str] | None = None) -> tuple[dict[str, str], pa.Table]:
    """Reads the header and some columns of a library file, by default all of them."""
    columns = SCHEMA.names if columns is None else columns
    remedy = "if it belongs to a library, delete it and collect its reaches again"
    with opened(path, remedy) as file:
        header = _check_schema(path, file.schema_arrow)
        table = file.read(columns=columns)
        # Checksums cover pages only: a damaged footer can hide rows.
        groups = [file.metadata.row_group(i) for i in range(file.num_row_groups)]
        rows = {file.metadata.num_rows, sum(group.num_rows for group in groups)}
        if rows != {table.num_rows}:
            raise pa.ArrowInvalid(f"inconsistent row counts {rows}")
        return header, table.select(columns)


def _check_schema(path: Path, schema: pa.Schema) -> dict[str, str]:
    """Returns the header of a file after checking that this version can read it."""
    metadata = schema.metadata or {}
    header = {name: metadata.get(f"{_PREFIX}{name}".encode(), b"").decode() for name in _HEADER}
    if not all(header.values()):
        raise LibraryError(
            f"{path} is not part of an experience library (no lic_drake metadata);"
            " move it out of the library's folder"
        )
    version = header["schema_version"]
    if version != str(SCHEMA_VERSION) or not schema.equals(SCHEMA, check_metadata=False):
        raise LibraryError(
            f"{path} has schema version {quoted(version)}, written by lic_drake"
            f" {quoted(header['lic_drake_version'])}, or other columns; this lic_drake"
            f" {lic_drake.__version__} reads version {SCHEMA_VERSION}: use that lic_drake, or"
            " collect the library again"
        )
    return header
