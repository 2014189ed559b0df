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
from lic_drake.errors import LibraryError, RequestError, quoted
from lic_drake.experience.schema import SCHEMA
from lic_drake.experience.store import SUFFIX, ExperienceLibrary
from lic_drake.reach.request import SIMULATION, ReachRecord, check_goal
from lic_drake.reach.scenario import Scenario

MAX_WEIGHT = 1000.0
"""Upper limit of a weight; its inverse is the lower limit."""

MAX_NUMBER = 1e6
"""Larger numbers, in SI units, are rejected as typing errors."""

START_TOLERANCE_M = 0.02
"""Allowed distance of a start from the start line, metres: calibration error and a hand-taught
start. LIC-1's features assume the line."""

_UNOBSERVED: dict[str, Any] = {
    **dict.fromkeys(("min_distance", "peak_force", "mean_force", "mean_contacts"), math.nan),
    **{"duration_s": math.nan, "wall_time_s": math.nan, "peak_contacts": 0},
    **{"q_start": (), "q_final": (), "detail": "", "drake_version": ""},
    **{"goal_z": 0.0, "start_phi": 0.0, "final_phi": 0.0},
}
"""Values of the columns that rows do not have."""


def add_file(
    library: ExperienceLibrary, path: Path, *, source: str, weight: float = 1.0
) -> list[ReachRecord]:
    """Adds the rows of a CSV or Parquet file; see `add_rows`."""
    read = {".csv": pyarrow.csv.read_csv, SUFFIX: pq.read_table}.get(path.suffix)
    if read is None:
        raise LibraryError(f"rows are added from a .csv or {SUFFIX} file, got {path}")
    try:
        table = read(path)
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:200]
        raise LibraryError(f"cannot read {path} as {path.suffix[1:]} ({reason})") from None
    rows = table.rename_columns([name.strip() for name in table.column_names]).to_pylist()
    return add_rows(library, rows, source=source, weight=weight, origin=path.name)


def add_rows(
    library: ExperienceLibrary,
    rows: Iterable[Mapping[str, object]],
    *,
    source: str,
    weight: float = 1.0,
    origin: str = "",
) -> list[ReachRecord]:
    """Validates rows and adds them to a library; either all are written or none.

    Args:
        library: A folder with reaches, whose scenario the rows belong to.
        rows: One mapping per row with the columns of `columns_of`. Values may be text; None and
            empty text mean "not observed".
        source: Who made them: letters, digits, dots, dashes and underscores.
        weight: Number of simulated reaches that each row counts as.
        origin: Name of the rows in error messages; the source by default.

    Returns:
        The rows as stored in the library.

    Raises:
        LibraryError: A value, the source or the weight is invalid, the rows were added before, the
            library is a single file, or it cannot be read or written.
    """
    origin = origin or source
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,100}", source) or source == SIMULATION:
        raise LibraryError(f"{quoted(source)} cannot be the name of a source; use one like lab-arm")
    if not 1.0 / MAX_WEIGHT <= weight <= MAX_WEIGHT:
        raise LibraryError(
            f"a weight is from {1.0 / MAX_WEIGHT:g} to {MAX_WEIGHT:g} simulated reaches, got"
            f" {weight:g}"
        )
    if library.path.is_file():
        raise LibraryError(f"{library.path} is a single file; rows are added to folders only")
    scenario = library.scenario()
    values = check_rows(rows, scenario, origin)
    digest = _digest(repr(values))
    records = [
        ReachRecord(
            **row,
            key=_digest(f"{digest} {i}"),
            category=scenario.category,
            robot=scenario.robot,
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
                f"the {len(records)} rows of {origin} were added before; to change their weight or"
                f" source, delete their file in {library.path} first"
            )
        library.write_shard(records[0].stream, records, scenario)
    return records


def columns_of(scenario: Scenario) -> dict[str, float | None]:
    """Returns the columns that rows may have, each with its default.

    None marks a required column, NaN one that may be unobserved. Names and units are those of
    `lic_drake.experience.schema.SCHEMA`.
    """
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


def check_rows(
    rows: Iterable[Mapping[str, object]], scenario: Scenario, origin: str
) -> list[dict[str, Any]]:
    """Returns rows as values of the fields of `ReachRecord` that a robot can observe.

    Each row without an environment is given one of its own.

    Raises:
        LibraryError: There are no rows, a column is missing or unknown, or a value is invalid; the
            message names the row (from 1), the value, the limit and what to do.
    """
    listed, columns = list(rows), columns_of(scenario)
    required = [name for name, default in columns.items() if default is None]
    given = {str(name) for row in listed for name in row}
    if not listed:
        raise LibraryError(f"{origin} holds no rows; give at least one")
    if wrong := sorted(given - columns.keys()) or [name for name in required if name not in given]:
        raise LibraryError(
            f"{origin} {'has an unknown' if wrong[0] in given else 'lacks the'} column"
            f" {quoted(wrong[0])}; rows of {scenario.category} need {', '.join(required)} and may"
            f" have {', '.join(name for name in columns if name not in required)}"
        )
    unobserved = dict(_UNOBSERVED)
    if "torso" in columns:
        unobserved |= dict.fromkeys(("final_qw", "final_qx", "final_qy", "final_qz"), math.nan)
    checked: list[dict[str, Any]] = []
    for i, row in enumerate(listed, start=1):
        where = f"{origin}, row {i}"
        numbers = {n: _number(row.get(n), n, d, where) for n, d in columns.items()}
        _check_ranges(numbers, scenario, where)
        success = bool(numbers["success"])
        outcome = "reached" if success else "failed"
        checked.append({**unobserved, **numbers, "success": success, "outcome": outcome})
    first = int(max((row["environment"] for row in checked if row["environment"] >= 0), default=-1))
    for i, values in enumerate(checked, start=first + 1):
        alone = math.isnan(values["environment"])
        values["environment"] = i if alone else int(values["environment"])
    return checked


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _number(value: object, name: str, default: float | None, where: str) -> float:
    """Returns a value as a number; false and true are 0 and 1."""
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
    if name == "environment" and not number.is_integer():
        raise LibraryError(f"{where}: environment is {quoted(value)}; it must be a whole number")
    if not abs(number) <= MAX_NUMBER:
        unit = SCHEMA.field(name).metadata[b"unit"].decode()
        raise LibraryError(
            f"{where}: {name} is {quoted(value)}; it must be a number{unit and f' in {unit}'} up to"
            f" {MAX_NUMBER:g}: correct it or leave the row out"
        )
    return number


def _check_ranges(row: Mapping[str, float], scenario: Scenario, where: str) -> None:
    """Rejects a row that is impossible for the scenario's robot and task."""
    b0 = np.array([row["base_x"], row["base_y"], row.get("torso", 0.0)])
    try:
        check_goal(scenario, [row["goal_x"], row["goal_y"], row.get("goal_z", 0.0)] - b0)
    except RequestError as error:
        raise LibraryError(f"{where}: {error}, or leave the row out") from None
    if "torso" in row:
        length = math.hypot(*(row[f"start_q{axis}"] for axis in "wxyz"))
        limits = [("the length of the quaternion start_qw to start_qz", length, 0.999, 1.001, "")]
    else:
        line, unit = (
            scenario.task.start_line,
            f" m from the base ({scenario.category}'s start line)",
        )
        limits = [
            ("start_phi", row["start_phi"], -3.1416, 3.1416, " rad, not degrees"),
            ("final_phi", row["final_phi"], -3.1416, 3.1416, " rad, not degrees"),
            ("start_x", row["start_x"] - b0[0], line.x_m, line.x_m, unit),
            ("start_y", row["start_y"] - b0[1], line.y_min_m, line.y_max_m, unit),
        ]
    for name, value, low, high, unit in limits:
        tolerance = START_TOLERANCE_M if unit.startswith(" m") else 0.0
        if value < low - tolerance or value > high + tolerance:  # NaN is an unobserved value.
            raise LibraryError(
                f"{where}: {name} is {value:g}, but must be from {low - tolerance:g} to"
                f" {high + tolerance:g}{unit}; correct it or leave the row out"
            )
