"""Experience of real or other simulated robots, added to a library (paper VII).

It lies in the library's folder in files of its own, which readers of the simulated reaches pass
over: these stay a pure function of their requests. Nothing is ever merged or overwritten; to take
an addition back, delete its file.
"""

import csv
import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import lic_drake
from lic_drake.errors import LibraryError, quoted
from lic_drake.experience.added_rows import COLUMNS, Columns, check_rows
from lic_drake.experience.files import readable_errors, write_atomically
from lic_drake.experience.store import SUFFIX, ExperienceLibrary

FOLDER = "_added"
"""Where additions lie in a library's folder; Parquet readers pass over names that begin so."""

MAX_WEIGHT = 1000.0
"""A larger weight, or one below its inverse, is refused: the rest would count for nothing."""

VERSION = 1
"""Grows with every change of the columns or the metadata."""

_KINDS = {"success": pa.bool_(), "environment": pa.int64()}

SCHEMA = pa.schema(
    [
        pa.field(
            name,
            _KINDS.get(name, pa.float64()),
            nullable=False,
            metadata={"unit": column.unit, "doc": column.doc},
        )
        for name, column in COLUMNS.items()
    ]
)
"""The columns of an addition."""


@dataclass(frozen=True, kw_only=True)
class Addition:
    """Records that were added at one time.

    Attributes:
        path: The file.
        category: Clutter category.
        source: Who made the records, for instance the robot's name.
        weight: How many simulated reaches each of them counts as.
        records: Number of records.
        successes: How many of them reached their goal.
        origin: Name of the file that they were read from; empty if none.
        lic_drake_version: Version that added them.
    """

    path: Path
    category: str
    source: str
    weight: float
    records: int
    successes: int
    origin: str
    lic_drake_version: str

    def values(self) -> dict[str, object]:
        """Returns the attributes as JSON can hold them."""
        return {**asdict(self), "path": str(self.path)}

    def describe(self) -> str:
        """Returns one line for people."""
        return (
            f"{self.records} records of {self.source}, {self.successes} at the goal, each with the"
            f" weight of {self.weight:g} simulated reaches: {self.path}"
        )


def add_file(
    library: ExperienceLibrary, path: Path, *, source: str, weight: float = 1.0
) -> Addition:
    """Adds the records of a CSV or Parquet file; see `add_records`."""
    rows = _read_rows(path)
    return add_records(library, rows, source=source, weight=weight, origin=path.name)


def add_records(
    library: ExperienceLibrary,
    rows: Iterable[Mapping[str, object]],
    *,
    source: str,
    weight: float = 1.0,
    origin: str = "",
) -> Addition:
    """Adds records to a library after checking all of them; all or none are written.

    Args:
        library: A folder with simulated reaches; it says category, arm and start line.
        rows: Records, see `lic_drake.experience.added_rows.COLUMNS`.
        source: Who made them: letters, digits, dots, dashes and underscores.
        weight: How many simulated reaches each record counts as.
        origin: What messages and the file's metadata call the place that they come from.

    Raises:
        LibraryError: A record, the source or the weight is refused, the same records were added
            before, the library is a single file, or it cannot be read or written.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,100}", source):
        raise LibraryError(
            f"{quoted(source)} cannot be the name of a source; use letters, digits, dots, dashes"
            " and underscores, at most 101, for instance lab-arm"
        )
    if not 1.0 / MAX_WEIGHT <= weight <= MAX_WEIGHT:
        raise LibraryError(
            f"a weight must be from {1.0 / MAX_WEIGHT:g} to {MAX_WEIGHT:g} simulated reaches, got"
            f" {weight:g}"
        )
    scenario = library.scenario()
    if library.path.is_file():
        raise LibraryError(
            f"{library.path} is a single file, and additions lie beside the files of a library;"
            " move it into a folder of its own and add to that"
        )
    columns = check_rows(rows, scenario, origin or source)
    table = pa.Table.from_pydict(columns, schema=SCHEMA)
    digest = _digest(columns)
    known = {_digest(read_columns(path)): path for path in addition_paths(library)}
    if digest in known:
        raise LibraryError(
            f"these {len(table)} records are in {known[digest]} already; to change their weight or"
            " source, delete that file first"
        )
    folder = library.path / FOLDER
    with readable_errors(folder, "create the folder"):
        folder.mkdir(exist_ok=True)
    path = folder / f"{source}-{digest[:12]}{SUFFIX}"
    metadata = {
        "added_version": VERSION,
        "lic_drake_version": lic_drake.__version__,
        "category": scenario.category,
        "source": source,
        "weight": repr(float(weight)),
        "origin": origin,
    }
    table = table.replace_schema_metadata({f"lic_drake.{k}": str(v) for k, v in metadata.items()})
    write_atomically(
        path,
        lambda temporary: pq.write_table(
            table, temporary, compression="zstd", write_page_checksum=True
        ),
    )
    return read_addition(path)


def addition_paths(library: ExperienceLibrary) -> list[Path]:
    """Returns the files of a library's additions, sorted by name."""
    folder = library.path / FOLDER
    with readable_errors(folder, "read"):
        return sorted(p for p in folder.glob(f"*{SUFFIX}") if not p.name.startswith("."))


def additions(library: ExperienceLibrary) -> tuple[Addition, ...]:
    """Returns what was added to a library.

    Raises:
        LibraryError: A file is damaged or no addition.
    """
    return tuple(read_addition(path) for path in addition_paths(library))


def added_columns(library: ExperienceLibrary) -> Columns | None:
    """Returns all added records of a library, None if there are none.

    Returns:
        `COLUMNS`, with the `weight` of each record and its `stream`, which is another one for each
        file, so that no environment is taken for one of the simulation or of another source.

    Raises:
        LibraryError: A file is damaged, no addition, or of another category than the library.
    """
    paths = addition_paths(library)
    if not paths:
        return None
    category = library.scenario().category
    parts = []
    for path in paths:
        addition = read_addition(path)
        if addition.category != category:
            raise LibraryError(
                f"{path} holds records of {quoted(addition.category)}, its library {category};"
                " move it to a library of its category"
            )
        count = addition.records
        more = {
            "weight": np.full(count, addition.weight),
            "stream": np.full(count, path.stem, dtype=object),
        }
        parts.append({**read_columns(path), **more})
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def read_addition(path: Path) -> Addition:
    """Reads what a file of added records says of itself, and all of its records.

    Raises:
        LibraryError: It is damaged or no addition.
    """
    columns = read_columns(path)
    metadata = _metadata(pq.read_schema(path))
    try:
        return Addition(
            path=path,
            category=metadata["category"],
            source=metadata["source"],
            weight=float(metadata["weight"]),
            records=len(columns["success"]),
            successes=int(columns["success"].sum()),
            origin=metadata["origin"],
            lic_drake_version=metadata["lic_drake_version"],
        )
    except (KeyError, ValueError):
        raise LibraryError(
            f"{path} lost its metadata; delete it and add its records again"
        ) from None


def read_columns(path: Path) -> Columns:
    """Reads the records of an addition.

    Raises:
        LibraryError: It is damaged or no addition.
    """
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            metadata, schema = _metadata(file.schema_arrow), file.schema_arrow
            table = file.read()
    except (OSError, UnicodeDecodeError, pa.ArrowException) as error:
        raise LibraryError(
            f"{path} is damaged or not a Parquet file; delete it and add its records again"
        ) from error
    if metadata.get("added_version") != str(VERSION) or not schema.equals(SCHEMA):
        raise LibraryError(
            f"{path} holds no records that this lic_drake {lic_drake.__version__} added; move it"
            f" away and add its records with: lic experience add"
        )
    return {name: table.column(name).to_numpy() for name in SCHEMA.names}


def _metadata(schema: pa.Schema) -> dict[str, str]:
    pairs = {k.decode(): v.decode() for k, v in (schema.metadata or {}).items()}
    return {k.removeprefix("lic_drake."): v for k, v in pairs.items()}


def _digest(columns: Columns) -> str:
    """Returns a digest of the records, in which neither source nor weight counts."""
    text = hashlib.sha256()
    for name in SCHEMA.names:
        text.update(np.ascontiguousarray(columns[name]).tobytes())
    return text.hexdigest()


def _read_rows(path: Path) -> list[dict[str, object]]:
    """Reads a CSV or Parquet file as rows."""
    if path.suffix not in (".csv", SUFFIX):
        raise LibraryError(f"records are added from a .csv or {SUFFIX} file, got {path}")
    try:
        if path.suffix == SUFFIX:
            rows: list[dict[str, object]] = pq.read_table(path).to_pylist()
            return rows
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, restkey="more values than columns", skipinitialspace=True)
            return [{str(k).strip(): v for k, v in row.items()} for row in reader]
    except FileNotFoundError:
        raise LibraryError(
            f"no file at {path}; give the .csv or {SUFFIX} file of records"
        ) from None
    except (OSError, UnicodeDecodeError, csv.Error, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read {path} ({reason}); is it what its name says?") from None
