"""Rows of a real or another simulated robot for a library, after checking every value (paper VII).

They become a shard of the library with a source and a weight. To take an addition back, delete
its file.
"""

import csv
import hashlib
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import lic_drake
from lic_drake.errors import LibraryError, RequestError, quoted
from lic_drake.experience.schema import SCHEMA
from lic_drake.experience.store import SUFFIX, ExperienceLibrary
from lic_drake.reach.request import SIMULATION, ReachRecord, check_goal
from lic_drake.reach.scenario import Scenario

MAX_WEIGHT = 1000.0
"""A larger weight, or one below its inverse, is refused: the rest would count for nothing."""

MAX_ROWS = 1_000_000
"""More rows at a time are refused."""

MAX_NUMBER = 1e6
"""A larger number, in SI units, is a slip of the keyboard."""

START_TOLERANCE_M = 0.02
"""So far from the start line or beyond its ends a hand may have started: a calibrated arm's error
and a taught start, and a fifth of the grid's step. The features of LIC-1 know the line only."""

_FINAL = ("final_x", "final_y", "final_vx", "final_vy")
_UNSEEN: dict[str, Any] = {
    **dict.fromkeys((*_FINAL, "min_distance", "peak_force", "mean_force"), math.nan),
    **dict.fromkeys(("mean_contacts", "duration_s", "wall_time_s"), math.nan),
    **{"peak_contacts": 0, "q_start": (), "q_final": (), "detail": "", "drake_version": ""},
}
"""Columns that were not observed."""


def add_file(
    library: ExperienceLibrary, path: Path, *, source: str, weight: float = 1.0
) -> list[ReachRecord]:
    """Adds the rows of a CSV or Parquet file; see `add_rows`."""
    return add_rows(library, _read_rows(path), source=source, weight=weight, origin=path.name)


def add_rows(
    library: ExperienceLibrary,
    rows: Iterable[Mapping[str, object]],
    *,
    source: str,
    weight: float = 1.0,
    origin: str = "",
) -> list[ReachRecord]:
    """Adds rows to a library after checking all of them; all or none are written.

    Args:
        library: A folder with reaches; it says category, arm and start line.
        rows: One mapping a row, by the names of the library's columns that `columns_of` returns.
            Values may be text, as in CSV; None and empty text are values that were not observed.
        source: Who made them: letters, digits, dots, dashes and underscores.
        weight: How many simulated reaches each row counts as.
        origin: What messages call the rows' origin; by default the source.

    Returns:
        The rows as they are in the library.

    Raises:
        LibraryError: A value, the source or the weight is refused, a row was added before, the
            library is a single file, or it cannot be read or written.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,100}", source) or source == SIMULATION:
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
            f"{library.path} is a single file; move it into a folder of its own and add to that"
        )
    values = check_rows(rows, scenario, origin or source)
    digest = _digest(repr(values))
    stream = f"{source}-{digest}"  # Its environments are nobody else's.
    with library.locked():
        keys = [_digest(f"{digest} {i}") for i in range(len(values))]
        if keys[0] in library.successes():
            raise LibraryError(
                f"the {len(keys)} rows of {origin or source} were added before; to change their"
                f" weight or source, delete their file in {library.path} first"
            )
        records = [
            ReachRecord(
                **value,
                key=key,
                category=scenario.category,
                robot=scenario.robot,
                scenario=scenario.digest,
                stream=stream,
                outcome="reached" if value["success"] else "failed",
                lic_drake_version=lic_drake.__version__,
                source=source,
                weight=float(weight),
            )
            for key, value in zip(keys, values, strict=True)
        ]
        library.write_shard(stream, records, scenario)
    return records


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def columns_of(scenario: Scenario) -> dict[str, float | None]:
    """Returns the columns of rows of a scenario's robot, with the value where one is empty.

    None has to be given, NaN stands for what was not observed. Names and units are those of the
    library (`lic_drake.experience.schema.SCHEMA`).
    """
    needed: dict[str, float | None] = dict.fromkeys(("success", "goal_x", "goal_y"))
    optional: dict[str, float | None] = {
        "base_x": 0.0,
        "environment": math.nan,
        **dict.fromkeys(_FINAL, math.nan),
    }
    if scenario.arm().is_planar:
        needed |= dict.fromkeys(("start_y", "start_phi"))
        optional |= {"start_x": scenario.task.start_line.x_m, "final_phi": math.nan, "base_y": 0.0}
        if scenario.task.base is not None:
            optional["base_y"] = None
        return needed | optional
    needed |= dict.fromkeys(("goal_z", "start_x", "start_y", "start_z", "base_y", "torso"))
    optional |= {"start_qw": 1.0, "start_qx": 0.0, "start_qy": 0.0, "start_qz": 0.0}
    return needed | optional | {"final_z": math.nan, "final_vz": math.nan}


def check_rows(
    rows: Iterable[Mapping[str, object]], scenario: Scenario, origin: str
) -> list[dict[str, Any]]:
    """Returns rows as values of all measured fields of `ReachRecord`, after checking every value.

    Rows without an environment get one of their own.

    Raises:
        LibraryError: There are no rows or too many, a column is missing or unknown, or a value
            cannot be; the message names row, value, limit and what to do. Rows count from 1, the
            names of the columns not among them.
    """
    listed = list(rows)
    if not 1 <= len(listed) <= MAX_ROWS:
        raise LibraryError(f"{origin} holds {len(listed)} rows; add 1 to {MAX_ROWS} at a time")
    columns = columns_of(scenario)
    needed = [name for name, default in columns.items() if default is None]
    given = {name for row in listed for name in row}
    if unknown := sorted(str(name) for name in given - columns.keys()):
        raise LibraryError(
            f"{origin} has a column {quoted(unknown[0])} that rows of {scenario.category} do not"
            f" have; rename it or leave it out: known are {', '.join(columns)}"
        )
    if missing := [name for name in needed if name not in given]:
        raise LibraryError(
            f"{origin} has no column {missing[0]!r}; rows of {scenario.category} need"
            f" {', '.join(needed)}"
        )
    in_plane = scenario.arm().is_planar
    unseen = _UNSEEN | ({"goal_z": 0.0} if in_plane else {"start_phi": 0.0, "final_phi": 0.0})
    if not in_plane:
        unseen |= {f"final_q{axis}": math.nan for axis in "wxyz"}
    checked: list[dict[str, Any]] = []
    for i, row in enumerate(listed, start=1):
        where = f"{origin}, row {i}"
        numbers = {n: _number(row.get(n), n, d, where) for n, d in columns.items()}
        _check(numbers, scenario, where)
        checked.append({**unseen, **numbers, "success": bool(numbers["success"])})
    numbered = [row["environment"] for row in checked if not math.isnan(row["environment"])]
    first = int(max(numbered, default=-1)) + 1
    for i, values in enumerate(checked):
        alone = math.isnan(values["environment"])
        values["environment"] = first + i if alone else int(values["environment"])
    return checked


def _number(value: object, name: str, default: float | None, where: str) -> float:
    """Returns a value as a number."""
    text = "" if value is None else str(value).strip().lower()
    if not text or (text == "nan" and default is not None):
        if default is None:
            raise LibraryError(f"{where}: {name} is empty; fill it in or leave the row out")
        return default
    if name == "success":
        if text not in ("true", "false", "0", "1", "0.0", "1.0"):
            raise LibraryError(
                f"{where}: success is {quoted(value)}, which must be true or false, 1 or 0"
            )
        return float(text in ("true", "1", "1.0"))
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not abs(number) <= MAX_NUMBER:
        unit = SCHEMA.field(name).metadata[b"unit"].decode()
        raise LibraryError(
            f"{where}: {name} is {quoted(value)}, which must be a number{unit and f' in {unit}'} up"
            f" to {MAX_NUMBER:g}; correct it or leave the row out"
        )
    return number


def _check(row: Mapping[str, float], scenario: Scenario, where: str) -> None:
    """Refuses a row that the library's robot could not have made in its category."""
    if not (math.isnan(row["environment"]) or row["environment"].is_integer()):
        raise LibraryError(
            f"{where}: environment is {row['environment']:g}, which must be a whole number"
        )
    for name in {"start_phi", "final_phi"} & row.keys():
        if abs(row[name]) > np.pi + 1e-6:
            raise LibraryError(
                f"{where}: {name} is {row[name]:g} rad, which must be from -3.1416 to 3.1416;"
                " directions are in radians, not degrees"
            )
    b0 = np.array([row["base_x"], row["base_y"], row.get("torso", 0.0)])
    p_WG = np.array([row["goal_x"], row["goal_y"], row.get("goal_z", 0.0)])
    try:
        check_goal(scenario, p_WG - b0)
    except RequestError as error:
        raise LibraryError(f"{where}: {error}, or leave the row out") from None
    if "torso" in row:
        if abs(np.linalg.norm([row[f"start_q{axis}"] for axis in "wxyz"]) - 1.0) > 1e-3:
            raise LibraryError(
                f"{where}: the quaternion start_qw, start_qx, start_qy, start_qz must have length 1"
                " within 0.001; divide it by its length"
            )
        return
    line = scenario.task.start_line
    for name, value, low, high in (
        ("start_x", row["start_x"] - row["base_x"], line.x_m, line.x_m),
        ("start_y", row["start_y"] - row["base_y"], line.y_min_m, line.y_max_m),
    ):
        if not low - START_TOLERANCE_M <= value <= high + START_TOLERANCE_M:
            raise LibraryError(
                f"{where}: {name} is {value:g} m from the base, which must be from"
                f" {low - START_TOLERANCE_M:g} to {high + START_TOLERANCE_M:g} m: the hand starts"
                f" on the start line of {scenario.category}; leave the row out"
            )


def _read_rows(path: Path) -> list[dict[str, object]]:
    """Reads a CSV or Parquet file as rows."""
    if path.suffix not in (".csv", SUFFIX):
        raise LibraryError(f"rows are added from a .csv or {SUFFIX} file, got {path}")
    try:
        if path.suffix == SUFFIX:
            rows: list[dict[str, object]] = pq.read_table(path).to_pylist()
            return rows
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, restkey="more values than columns", skipinitialspace=True)
            names = reader.fieldnames or []
            if len(names) == 1 and (";" in names[0] or "\t" in names[0]):
                raise LibraryError(
                    f"{path} separates its values by semicolons or tabs; save it with commas"
                    " between them and points in the numbers"
                )
            return [{str(k).strip(): v for k, v in row.items()} for row in reader]
    except FileNotFoundError:
        raise LibraryError(f"no file at {path}; give the .csv or {SUFFIX} file of rows") from None
    except (OSError, UnicodeDecodeError, csv.Error, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read {path} ({reason}); is it what its name says?") from None
