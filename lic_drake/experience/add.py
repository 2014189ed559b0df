"""Adds reaches of a real robot, or of another simulator, to a library (paper VII).

They become a shard with a source and a weight; to undo an addition, delete that file.
"""

import hashlib
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

import lic_drake
from lic_drake.errors import LibraryError, LicError, quoted
from lic_drake.experience.schema import SCHEMA
from lic_drake.experience.store import SUFFIX, ExperienceLibrary
from lic_drake.reach.request import SIMULATION, ReachRecord, check_goal
from lic_drake.reach.scenario import Scenario

_LIMITS = {
    **{"success": (0.0, 1.0), "environment": (0.0, 1e6)},
    **{"start_phi": (-3.1416, 3.1416), "final_phi": (-3.1416, 3.1416)},
}
"""Of the values of columns; others are at most 1e6, larger ones are typing errors."""

_UNOBSERVED: dict[str, Any] = {
    **dict.fromkeys(("min_distance", "peak_force", "mean_force", "mean_contacts"), math.nan),
    **{"duration_s": math.nan, "wall_time_s": math.nan, "peak_contacts": 0},
    **{"q_start": (), "q_final": (), "detail": "", "drake_version": ""},
    **{"goal_z": 0.0, "start_phi": 0.0, "final_phi": 0.0},
}
"""Values of the columns that rows do not have."""


def read_table(path: Path) -> pa.Table:
    """Reads a CSV or Parquet file, whose column names lose blanks around them."""
    read = {".csv": pyarrow.csv.read_csv, SUFFIX: pq.read_table}.get(path.suffix)
    if read is None:
        raise LibraryError(f"rows are read from a .csv or {SUFFIX} file, got {path}")
    if not path.is_file():
        raise LibraryError(f"there is no file {path}; check its name")
    try:
        table = read(path)
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read {path} as {path.suffix[1:]} ({reason})") from None
    return table.rename_columns([name.strip() for name in table.column_names])


def read_rows(path: Path) -> list[dict[str, object]]:
    """Reads the rows of a CSV or Parquet file, for `add_rows`."""
    table = read_table(path)
    for name in table.column_names:
        if (count := table.column_names.count(name)) > 1:
            raise LibraryError(f"{path} has {count} columns {quoted(name)}; keep one")
    rows: list[dict[str, object]] = table.to_pylist()
    return rows


def add_rows(
    library: ExperienceLibrary,
    rows: Iterable[Mapping[str, object]],
    *,
    source: str,
    weight: float = 1.0,
) -> list[ReachRecord]:
    """Validates rows and adds them to a library, all or none; returns them as stored.

    Args:
        library: A folder with reaches, whose scenario the rows belong to.
        rows: Each with the columns of `columns_of`; None and empty text mean "not observed".
        source: Who made them: letters, digits, dots, dashes and underscores.
        weight: Number of simulated reaches that each row counts as.
    """
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,100}", source) or source == SIMULATION:
        raise LibraryError(f"{quoted(source)} cannot be the name of a source; use one like lab-arm")
    if not 0.001 <= weight <= 1000.0:
        raise LibraryError(f"a weight is from 0.001 to 1000 simulated reaches, got {weight:g}")
    scenario = library.scenario()
    values = check_rows(rows, scenario)
    digest = _digest(repr(values))
    records = [
        ReachRecord(
            **row,
            key=_digest(f"{digest} {i}"),
            category=scenario.category,
            robot=scenario.arm().name,
            scenario=scenario.digest,
            stream=f"{source}-{digest}",  # Shares no environments with any other rows.
            lic_drake_version=lic_drake.__version__,
            source=source,
            weight=float(weight),
        )
        for i, row in enumerate(values)
    ]
    with library.locked():
        if records[0].key in library.successes():
            raise LibraryError(
                f"these {len(records)} rows were added before; to change their weight or source,"
                f" delete their file in {library.path} first"
            )
        library.write_shard(records[0].stream, records, scenario)
    return records


def columns_of(scenario: Scenario) -> dict[str, float | None]:
    """Returns the columns that rows may have, with defaults; None: required, NaN: unobserved."""
    columns: dict[str, float | None] = dict.fromkeys(("success", "goal_x", "goal_y", "start_y"))
    columns |= {"base_x": 0.0, "environment": math.nan}
    columns |= dict.fromkeys(("final_x", "final_y", "final_vx", "final_vy"), math.nan)
    task = scenario.task
    if scenario.arm().is_planar:
        columns |= {"start_phi": None, "start_x": task.start_line.x_m, "final_phi": math.nan}
        return columns | {"base_y": 0.0 if task.base is None else None}
    columns |= dict.fromkeys(("goal_z", "start_x", "start_z", "base_y", "torso"))
    columns |= {"start_qw": 1.0, "start_qx": 0.0, "start_qy": 0.0, "start_qz": 0.0}
    return columns | {"final_z": math.nan, "final_vz": math.nan}


def check_rows(rows: Iterable[Mapping[str, object]], scenario: Scenario) -> list[dict[str, Any]]:
    """Returns rows as values of the fields of `ReachRecord` that a robot can observe.

    Each row without an environment is given one of its own. Raises a LibraryError that names the
    wrong column, or row and value.
    """
    listed, columns = list(rows), columns_of(scenario)
    if not listed:
        raise LibraryError("there are no rows; give at least one")
    required = [name for name, default in columns.items() if default is None]
    given = {str(name) for row in listed for name in row}
    if wrong := sorted(given - columns.keys()) or [name for name in required if name not in given]:
        raise LibraryError(
            f"{'unknown' if wrong[0] in given else 'missing'} column {quoted(wrong[0])}; rows of"
            f" {scenario.category} need {', '.join(required)} and may have"
            f" {', '.join(name for name in columns if name not in required)}"
        )
    unobserved = dict(_UNOBSERVED)
    if "torso" in columns:
        unobserved |= dict.fromkeys(("final_qw", "final_qx", "final_qy", "final_qz"), math.nan)
    checked: list[dict[str, Any]] = []
    for i, row in enumerate(listed, start=1):
        try:
            numbers = {name: _number(row.get(name), name, d) for name, d in columns.items()}
            _check_place(numbers, scenario)
        except LicError as error:
            raise LibraryError(f"row {i}: {error}; correct it or leave the row out") from None
        success = bool(numbers["success"])
        outcome = "reached" if success else "failed"
        checked.append({**unobserved, **numbers, "success": success, "outcome": outcome})
    given_last = max((row["environment"] for row in checked if row["environment"] >= 0), default=-1)
    for i, values in enumerate(checked, start=int(given_last) + 1):
        alone = math.isnan(values["environment"])
        values["environment"] = i if alone else int(values["environment"])
    return checked


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _number(value: object, name: str, default: float | None) -> float:
    """Returns a value as a number; false and true are 0 and 1."""
    text = "" if value is None else str(value).strip().lower()
    if default is not None and text in ("", "nan"):
        return default
    try:
        number = float({"true": "1", "false": "0"}.get(text, text))
    except ValueError:
        number = math.nan
    low, high = _LIMITS.get(name, (-1e6, 1e6))
    whole = name in ("success", "environment")
    if not low <= number <= high or (whole and not number.is_integer()):
        unit = SCHEMA.field(name).metadata[b"unit"].decode()
        raise LibraryError(
            f"{name} is {quoted(value)}, but must be a {'whole ' * whole}number from {low:g} to"
            f" {high:g} {unit}".rstrip()
        )
    return number


def _check_place(row: Mapping[str, float], scenario: Scenario) -> None:
    """Rejects a goal out of reach, and a start off the start line or without a rotation."""
    b0 = np.array([row["base_x"], row["base_y"], row.get("torso", 0.0)])
    check_goal(scenario, [row["goal_x"], row["goal_y"], row.get("goal_z", 0.0)] - b0)
    line, off = scenario.task.start_line, 0.02  # Calibration error and a hand-taught start, m.
    limits = [
        ("start_x - base_x", row["start_x"] - b0[0], line.x_m - off, line.x_m + off),
        ("start_y - base_y", row["start_y"] - b0[1], line.y_min_m - off, line.y_max_m + off),
    ]
    if "torso" in row:
        length = math.hypot(*(row[f"start_q{axis}"] for axis in "wxyz"))
        limits = [("the length of the quaternion start_qw to start_qz", length, 0.999, 1.001)]
    for name, value, low, high in limits:
        if not low <= value <= high:
            raise LibraryError(f"{name} is {value:g}, but must be from {low:g} to {high:g}")
