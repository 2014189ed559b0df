"""The columns of an experience library, and conversion of records to and from Parquet.

The columns are the fields of `ReachRecord`, with unit and description as field metadata. The table
metadata holds the schema version and the whole scenario, so that every shard is self-contained.
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
"""Incremented with every change of the columns or the metadata."""

_TYPES: dict[Any, pa.DataType] = {
    str: pa.string(),
    int: pa.int64(),
    float: pa.float64(),
    bool: pa.bool_(),
    tuple[float, ...]: pa.list_(pa.field("element", pa.float64(), nullable=False)),
}


def schema_of(row: type[Any]) -> pa.Schema:
    """Returns the columns for a dataclass, with the metadata of its fields."""
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
"""The columns of a library, without the table metadata."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TableHeader:
    """Table metadata: versions of the schema and of lic_drake, digest and YAML of the scenario."""

    schema_version: int
    lic_drake_version: str
    scenario_digest: str
    scenario: str


def scenario_text(scenario: Scenario) -> str:
    """Returns a scenario as YAML that `parse_scenario` reads back."""
    return yaml.safe_dump(to_dict(scenario), sort_keys=False)


def make_header(scenario: Scenario) -> TableHeader:
    """Returns the metadata that this version of lic_drake writes for a scenario."""
    return TableHeader(
        schema_version=SCHEMA_VERSION,
        lic_drake_version=lic_drake.__version__,
        scenario_digest=scenario.digest,
        scenario=scenario_text(scenario),
    )


def to_table(records: Sequence[ReachRecord], header: TableHeader) -> pa.Table:
    """Returns records as a table, one row each, in order."""
    columns = {name: [getattr(record, name) for record in records] for name in SCHEMA.names}
    metadata = {f"lic_drake.{k}": str(v) for k, v in dataclasses.asdict(header).items()}
    return pa.Table.from_pydict(columns, schema=SCHEMA.with_metadata(metadata))


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


@contextmanager
def opened(path: Path, remedy: str) -> Iterator[pq.ParquetFile]:
    """Opens a Parquet file and turns read errors into a `LibraryError`.

    Args:
        path: The file.
        remedy: Advice for the message if it is damaged.
    """
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            yield file
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        # pyarrow also raises OSErrors for damaged files, but without an error number.
        number = getattr(error, "errno", None)
        if number is not None:
            raise LibraryError(f"cannot read {path}: {os.strerror(number)}") from None
        raise LibraryError(f"{path} is damaged or not a Parquet file; {remedy}") from error


def read_shard(path: Path, columns: list[str] | None = None) -> tuple[TableHeader, pa.Table]:
    """Reads the metadata and some columns of a library file, by default all of them.

    Raises:
        LibraryError: The file is missing, damaged, not part of an experience library, or of
            another schema version.
    """
    columns = SCHEMA.names if columns is None else columns
    with opened(
        path, "if it belongs to a library, delete it and collect its reaches again"
    ) as file:
        header = _check_schema(path, file.schema_arrow)
        table = file.read(columns=columns)
        # Checksums cover pages only: a damaged footer can hide rows.
        groups = [file.metadata.row_group(i) for i in range(file.num_row_groups)]
        rows = {file.metadata.num_rows, sum(group.num_rows for group in groups)}
        if rows != {table.num_rows}:
            raise pa.ArrowInvalid(f"inconsistent row counts {rows}")
        return header, table.select(columns)


def _check_schema(path: Path, schema: pa.Schema) -> TableHeader:
    """Returns the header of a schema after checking that this version can read it."""
    try:
        metadata = {k.decode(): v.decode() for k, v in (schema.metadata or {}).items()}
        values = {f.name: metadata[f"lic_drake.{f.name}"] for f in dataclasses.fields(TableHeader)}
        version = int(values.pop("schema_version"))
    except (KeyError, ValueError):
        raise LibraryError(
            f"{path} is not part of an experience library (no lic_drake metadata);"
            " move it out of the library's folder"
        ) from None
    header = TableHeader(schema_version=version, **values)
    if version != SCHEMA_VERSION:
        raise LibraryError(
            f"{path} has schema version {version}, written by lic_drake"
            f" {quoted(header.lic_drake_version)}; this lic_drake {lic_drake.__version__} reads"
            f" version {SCHEMA_VERSION}: use that lic_drake, or collect the library again"
        )
    if not schema.equals(SCHEMA, check_metadata=False):
        pairs = zip(SCHEMA, schema, strict=False)
        differing = set(SCHEMA.names) ^ set(schema.names) or {a.name for a, b in pairs if a != b}
        raise LibraryError(
            f"{path} does not have the columns of this lic_drake"
            f" ({', '.join(map(quoted, sorted(differing)[:5]))}); delete it and collect its reaches"
            " again"
        )
    return header
