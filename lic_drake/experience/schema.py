"""The columns of an experience library, and rows to and from tables.

The columns are the fields of `ReachRecord`, with their units and descriptions as metadata. The
table's metadata holds the schema's version and the whole scenario, so that a shard explains
itself. Nothing that is read from a file is executed or unpickled.
"""

import dataclasses
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

import lic_drake
from lic_drake.errors import LibraryError, quoted
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario, to_dict

SCHEMA_VERSION = 4
"""Grows with every change of the columns or the metadata."""

_TYPES: dict[Any, pa.DataType] = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    tuple[float, ...]: pa.list_(pa.field("element", pa.float64(), nullable=False)),
}


def schema_of(row: type[Any]) -> pa.Schema:
    """Returns the columns of a dataclass of rows, with the metadata of its fields."""
    return pa.schema(
        [
            pa.field(
                item.name,
                _TYPES[item.type],
                nullable=False,
                metadata={key: str(value) for key, value in item.metadata.items()},
            )
            for item in dataclasses.fields(row)
        ]
    )


SCHEMA = schema_of(ReachRecord)
"""The columns of a library, without the metadata that differs by table."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TableHeader:
    """The metadata of a table.

    Attributes:
        schema_version: Version of the columns.
        lic_drake_version: Version that wrote the table.
        scenario_digest: Digest of the scenario, `Scenario.digest`.
        scenario: The whole scenario as YAML text, for `lic_drake.reach.scenario.parse_scenario`.
    """

    schema_version: int
    lic_drake_version: str
    scenario_digest: str
    scenario: str


def scenario_text(scenario: Scenario) -> str:
    """Returns every value of a scenario as YAML; `parse_scenario` reads it back."""
    return yaml.safe_dump(to_dict(scenario), sort_keys=False)


def make_header(scenario: Scenario) -> TableHeader:
    """Returns the metadata for rows of a scenario, as this version of lic_drake writes it."""
    return TableHeader(
        schema_version=SCHEMA_VERSION,
        lic_drake_version=lic_drake.__version__,
        scenario_digest=scenario.digest,
        scenario=scenario_text(scenario),
    )


def to_table(records: Sequence[ReachRecord], header: TableHeader) -> pa.Table:
    """Returns records as a table, one row each, in their order."""
    columns = {name: [getattr(record, name) for record in records] for name in SCHEMA.names}
    metadata = {f"lic_drake.{k}": str(v) for k, v in dataclasses.asdict(header).items()}
    return pa.Table.from_pydict(columns, schema=SCHEMA.with_metadata(metadata))


def to_records(table: pa.Table) -> list[ReachRecord]:
    """Returns the rows of a table; every float has the bits that it was written with."""
    lists = [field.name for field in SCHEMA if pa.types.is_list(field.type)]
    return [
        ReachRecord(**{**row, **{name: tuple(row[name]) for name in lists}})
        for row in table.to_pylist()
    ]


def write_table(table: pa.Table, path: Path) -> None:
    """Writes a table as a Parquet file with checksums."""
    # Dictionaries would merge NaNs of different bits, so floats go without.
    texts = [field.name for field in table.schema if field.type == pa.string()]
    pq.write_table(table, path, compression="zstd", use_dictionary=texts, write_page_checksum=True)


@contextmanager
def opened(path: Path, remedy: str) -> Iterator[pq.ParquetFile]:
    """Opens a Parquet file; what is wrong with it becomes a `LibraryError`.

    Args:
        path: The file.
        remedy: What to do if it is damaged.
    """
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            yield file
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        # Damage makes pyarrow raise OSErrors, too, but without an error number.
        number = getattr(error, "errno", None)
        if number is not None:
            raise LibraryError(f"cannot read {path}: {os.strerror(number)}") from None
        raise LibraryError(f"{path} is damaged or not a Parquet file; {remedy}") from error


def read_header(path: Path) -> TableHeader:
    """Reads the metadata of a library file.

    Raises:
        LibraryError: As `read_table`.
    """
    return _read(path, [])[0]


def read_table(path: Path, columns: list[str] | None = None) -> pa.Table:
    """Reads a library file.

    Args:
        path: A Parquet file.
        columns: The columns to read; all of them by default.

    Raises:
        LibraryError: The file is missing, damaged, not part of an experience library, or of
            another schema version.
    """
    return _read(path, columns)[1]


def _read(path: Path, columns: list[str] | None) -> tuple[TableHeader, pa.Table]:
    """Reads header and columns and checks what can be checked."""
    remedy = "if it belongs to a library, delete it and collect its reaches again"
    wanted = SCHEMA.names if columns is None else columns
    with opened(path, remedy) as file:
        header = _check_schema(path, file.schema_arrow)
        table = file.read(columns=wanted)
        # Checksums are of pages only: a damaged footer can hide rows.
        groups = [file.metadata.row_group(i) for i in range(file.num_row_groups)]
        rows = {file.metadata.num_rows, sum(group.num_rows for group in groups)}
        if rows != {table.num_rows}:
            raise pa.ArrowInvalid(f"rows of the parts and of the whole differ: {rows}")
        return header, table.select(wanted)


def _check_schema(path: Path, schema: pa.Schema) -> TableHeader:
    """Returns the header of a schema that this version can read."""
    try:
        metadata = {k.decode(): v.decode() for k, v in (schema.metadata or {}).items()}
        header = TableHeader(
            schema_version=int(metadata["lic_drake.schema_version"]),
            lic_drake_version=metadata["lic_drake.lic_drake_version"],
            scenario_digest=metadata["lic_drake.scenario_digest"],
            scenario=metadata["lic_drake.scenario"],
        )
    except (KeyError, ValueError):
        raise LibraryError(
            f"{path} is not part of an experience library (no lic_drake metadata);"
            " move it out of the library's folder"
        ) from None
    if header.schema_version != SCHEMA_VERSION:
        raise LibraryError(
            f"{path} has schema version {quoted(header.schema_version)}, written by lic_drake"
            f" {quoted(header.lic_drake_version)}; this lic_drake {lic_drake.__version__} reads"
            f" version {SCHEMA_VERSION}: use that lic_drake, or collect the library again"
        )
    if not schema.equals(SCHEMA, check_metadata=False):
        odd = sorted(set(SCHEMA.names) ^ set(schema.names)) or [
            mine.name for mine, theirs in zip(SCHEMA, schema, strict=False) if mine != theirs
        ]
        names = ", ".join(map(quoted, odd[:5])) or "some twice"
        raise LibraryError(
            f"{path} has other columns than this lic_drake writes ({names});"
            " delete it and collect its reaches again"
        )
    return header
