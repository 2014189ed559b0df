"""Rows of a real or another simulated robot for a library, after checking every value (paper VII).

They become a shard with a source and a weight. To take an addition back, delete its file.
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
"""A larger weight, or one below its inverse, would leave nothing of the other rows."""

MAX_NUMBER = 1e6
"""A larger number, in SI units, is a slip of the keyboard."""

START_TOLERANCE_M = 0.02
"""How far off the start line a hand may have started: a calibrated arm's error and a taught start,
and a fifth of the grid's step. The features of LIC-1 know the line only."""

_FINAL = ("final_x", "final_y", "final_vx", "final_vy")
_UNSEEN: dict[str, Any] = {
    **dict.fromkeys(("min_distance", "peak_force", "mean_force", "mean_contacts"), math.nan),
    **{"duration_s": math.nan, "wall_time_s": math.nan, "peak_contacts": 0},
    **{"q_start": (), "q_final": (), "detail": "", "drake_version": ""},
}
"""Columns that are not observed."""


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
        library: A folder with reaches, which says the scenario.
        rows: One mapping a row, see `columns_of`. Values may be text, as in CSV; None and empty
            text are values that were not observed.
        source: Who made them: letters, digits, dots, dashes and underscores.
        weight: How many simulated reaches each row counts as.
        origin: What messages call the rows' origin; by default the source.

    Returns:
        The rows as they are in the library.

    Raises:
        LibraryError: A value, the source or the weight is refused, the rows were added before, the
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
        raise LibraryError(f"{library.path} is a single file; add to a folder that you move it to")
    values = check_rows(rows, scenario, origin or source)
    digest = _digest(repr(values))
    constant: dict[str, Any] = {
        "category": scenario.category,
        "robot": scenario.robot,
        "scenario": scenario.digest,
        "stream": f"{source}-{digest}",  # Its environments are nobody else's.
        "lic_drake_version": lic_drake.__version__,
        "source": source,
        "weight": float(weight),
    }
    records = [
        ReachRecord(**constant, **value, key=_digest(f"{digest} {i}"))
        for i, value in enumerate(values)
    ]
    with library.locked():
        if records[0].key in library.successes():
            raise LibraryError(
                f"the {len(records)} rows of {origin or source} were added before; to change their"
                f" weight or source, delete their file in {library.path} first"
            )
        library.write_shard(records[0].stream, records, scenario)
    return records


def columns_of(scenario: Scenario) -> dict[str, float | None]:
    """Returns the columns that rows of a scenario's robot may have, with their values where empty.

    None has to be given, NaN is not observed. Names and units are those of the library
    (`lic_drake.experience.schema.SCHEMA`).
    """
    columns: dict[str, float | None] = dict.fromkeys(("success", "goal_x", "goal_y", "start_y"))
    columns |= {"base_x": 0.0, "environment": math.nan, **dict.fromkeys(_FINAL, math.nan)}
    task = scenario.task
    if scenario.arm().is_planar:
        columns |= {"start_phi": None, "start_x": task.start_line.x_m, "final_phi": math.nan}
        return columns | {"base_y": 0.0 if task.base is None else None}
    columns |= dict.fromkeys(("goal_z", "start_x", "start_z", "base_y", "torso"))
    columns |= {"start_qw": 1.0, "start_qx": 0.0, "start_qy": 0.0, "start_qz": 0.0}
    return columns | {"final_z": math.nan, "final_vz": math.nan}


def check_rows(
    rows: Iterable[Mapping[str, object]], scenario: Scenario, origin: str
) -> list[dict[str, Any]]:
    """Returns rows as values of the fields of `ReachRecord` that a robot can know.

    Rows without an environment get one of their own.

    Raises:
        LibraryError: There are no rows, a column is missing or unknown, or a value cannot be; the
            message names row, value, limit and what to do. Rows count from 1.
    """
    listed, columns = list(rows), columns_of(scenario)
    needed = [name for name, default in columns.items() if default is None]
    given = {name for row in listed for name in row}
    if not listed:
        raise LibraryError(f"{origin} holds no rows; give at least one")
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
    unseen: dict[str, Any] = {**_UNSEEN, "goal_z": 0.0, "start_phi": 0.0, "final_phi": 0.0}
    if "torso" in columns:
        unseen |= dict.fromkeys(("final_qw", "final_qx", "final_qy", "final_qz"), math.nan)
    checked: list[dict[str, Any]] = []
    for i, row in enumerate(listed, start=1):
        where = f"{origin}, row {i}"
        numbers = {n: _number(row.get(n), n, d, where) for n, d in columns.items()}
        _check(numbers, scenario, where)
        success = bool(numbers["success"])
        outcome = "reached" if success else "failed"
        checked.append({**unseen, **numbers, "success": success, "outcome": outcome})
    numbered = [row["environment"] for row in checked if not math.isnan(row["environment"])]
    first = int(max(numbered, default=-1)) + 1
    for i, values in enumerate(checked):
        alone = math.isnan(values["environment"])
        values["environment"] = first + i if alone else int(values["environment"])
    return checked


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _number(value: object, name: str, default: float | None, where: str) -> float:
    """Returns a value as a number; that of a truth is 0 or 1."""
    text = "" if value is None else str(value).strip().lower()
    if default is not None and text in ("", "nan"):
        return default
    if name == "success":
        text = {"true": "1", "false": "0"}.get(text, text)
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if name == "success" and number not in (0.0, 1.0):
        raise LibraryError(f"{where}: success is {quoted(value)}; it must be true or false, 1 or 0")
    if not abs(number) <= MAX_NUMBER:
        unit = SCHEMA.field(name).metadata[b"unit"].decode()
        raise LibraryError(
            f"{where}: {name} is {quoted(value)}; it must be a number{unit and f' in {unit}'} up to"
            f" {MAX_NUMBER:g}: correct it or leave the row out"
        )
    return number


def _check(row: Mapping[str, float], scenario: Scenario, where: str) -> None:
    """Refuses a row that the library's robot could not have made in its category."""
    if not (math.isnan(row["environment"]) or row["environment"].is_integer()):
        raise LibraryError(f"{where}: environment is {row['environment']:g}; give a whole number")
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
            if re.search("[;\t]", "".join(reader.fieldnames or [])):
                raise LibraryError(
                    f"{path} separates its values by semicolons or tabs; save it with commas"
                    " between them and points in the numbers"
                )
            return [{str(k).strip(): v for k, v in row.items()} for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read {path} ({reason}); is it what its name says?") from None
