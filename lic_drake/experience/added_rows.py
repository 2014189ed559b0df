"""What a record of a real or another simulated robot must hold, and whether it does.

A record is a row of a CSV or Parquet file, with the names and units of `ReachRecord`; `COLUMNS`
says what each column means. Which of them are needed depends on the library's scenario.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError, RequestError, quoted
from lic_drake.reach.request import check_goal
from lic_drake.reach.scenario import Scenario
from lic_drake.robots.planar import PlanarArm
from lic_drake.types import Vector

Columns = dict[str, NDArray[Any]]
"""Arrays of equal length by the names of columns."""

MAX_ROWS = 1_000_000
"""More records at a time are refused."""

START_TOLERANCE_M = 0.02
"""So far from the start line or beyond its ends a hand may have started: a calibrated arm's error
and a taught start, and a fifth of the grid's step. The features of LIC-1 know the line only."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of records that are added to a library.

    Attributes:
        doc: What it holds.
        unit: SI unit; empty for a plain number.
        default: Value where a file has no such column; NaN for what was not observed, None where
            it has to be there.
        plane: Whether records in the plane have it.
        space: Whether records in space have it.
    """

    doc: str
    unit: str = ""
    default: float | None = None
    plane: bool = True
    space: bool = True


_UNSEEN = float("nan")

COLUMNS = {
    "success": Column(doc="whether the tool came to the goal: true or false, 1 or 0"),
    "goal_x": Column(doc="goal p_WG", unit="m"),
    "goal_y": Column(doc="goal p_WG", unit="m"),
    "goal_z": Column(doc="goal p_WG", unit="m", plane=False),
    "start_x": Column(doc="tool at the start; by default the start line's x", unit="m"),
    "start_y": Column(doc="tool at the start", unit="m"),
    "start_z": Column(doc="tool at the start", unit="m", plane=False),
    "start_phi": Column(doc="direction of the hand from +x", unit="rad", space=False),
    "start_qw": Column(doc="tool's quaternion at the start", default=1.0, plane=False),
    "start_qx": Column(doc="tool's quaternion at the start", default=0.0, plane=False),
    "start_qy": Column(doc="tool's quaternion at the start", default=0.0, plane=False),
    "start_qz": Column(doc="tool's quaternion at the start", default=0.0, plane=False),
    "base_x": Column(doc="base p_WR", unit="m", default=0.0),
    "base_y": Column(doc="base p_WR; needed where the base moves", unit="m", default=0.0),
    "torso": Column(doc="height of the torso", unit="m", plane=False),
    "environment": Column(
        doc="number of the clutter; equal for attempts at one goal in one place, which LIC-2"
        " learns from; by default another one for each row",
        default=_UNSEEN,
    ),
    "final_x": Column(doc="tool at the end", unit="m", default=_UNSEEN),
    "final_y": Column(doc="tool at the end", unit="m", default=_UNSEEN),
    "final_z": Column(doc="tool at the end", unit="m", default=_UNSEEN, plane=False),
    "final_phi": Column(doc="direction at the end", unit="rad", default=_UNSEEN, space=False),
    "final_vx": Column(doc="mean velocity in the last second", unit="m/s", default=_UNSEEN),
    "final_vy": Column(doc="mean velocity in the last second", unit="m/s", default=_UNSEEN),
    "final_vz": Column(
        doc="mean velocity in the last second", unit="m/s", default=_UNSEEN, plane=False
    ),
}
"""The columns by name. Positions and directions are in the world frame W, as in `ReachRecord`."""


def check_rows(rows: Iterable[Mapping[str, object]], scenario: Scenario, source: str) -> Columns:
    """Returns records as columns after checking every value.

    Args:
        rows: One mapping a record, by the names of `COLUMNS`. Values may be text, as in CSV. A
            value that is None or empty text counts as not given.
        scenario: Of the library: its arm and its start line say what is possible.
        source: What messages call the records' origin.

    Returns:
        All of `COLUMNS`; what the robot does not have is 0, what was not observed NaN.

    Raises:
        LibraryError: There are no rows or too many, a column is missing or unknown, or a value
            cannot be; the message names row, value, limit and what to do. Rows count from 1, the
            names of the columns not among them.
    """
    listed = [dict(row) for row in rows]
    if not 1 <= len(listed) <= MAX_ROWS:
        raise LibraryError(f"{source} holds {len(listed)} records; add 1 to {MAX_ROWS} at a time")
    in_plane = isinstance(scenario.arm(), PlanarArm)
    known = {n: c for n, c in COLUMNS.items() if (c.plane if in_plane else c.space)}
    needed = _needed(scenario, known, in_plane)
    given = {name for row in listed for name in row}
    if unknown := sorted(str(name) for name in given - known.keys()):
        raise LibraryError(
            f"{source} has a column {quoted(unknown[0])} that records of {scenario.category} do not"
            f" have; rename it or leave it out: known are {', '.join(known)}"
        )
    if missing := [name for name in needed if name not in given]:
        unit = f", {known[missing[0]].unit}" if known[missing[0]].unit else ""
        raise LibraryError(
            f"{source} has no column {missing[0]!r} ({known[missing[0]].doc}{unit}); records of"
            f" {scenario.category} need {', '.join(needed)}"
        )
    columns: Columns = {name: np.zeros(len(listed)) for name in COLUMNS}
    line_x = scenario.task.start_line.x_m
    for name, column in known.items():
        default = line_x if name == "start_x" and in_plane else column.default
        values = [
            _value(row.get(name), name, None if name in needed else default, f"{source}, row {i}")
            for i, row in enumerate(listed, start=1)
        ]
        columns[name] = np.array(values)
    for i in range(len(listed)):
        _check_record(
            {n: float(v[i]) for n, v in columns.items()}, scenario, f"{source}, row {i + 1}"
        )
    columns["success"] = columns["success"].astype(bool)
    columns["environment"] = _numbered(columns["environment"])
    return columns


def _needed(scenario: Scenario, known: Mapping[str, Column], in_plane: bool) -> list[str]:
    """Returns the columns that records of a scenario have to have."""
    needed = [name for name, column in known.items() if column.default is None]
    if in_plane:
        needed.remove("start_x")
    if not in_plane or scenario.task.base is not None:
        needed.append("base_y")
    return needed


def _value(value: object, name: str, default: float | None, where: str) -> float:
    """Returns a value as a number."""
    if value is None or value == "":
        if default is None:
            raise LibraryError(f"{where}: {name} is empty; fill it in or leave the row out")
        return default
    text = str(value).strip().lower()
    if name == "success":
        if text not in ("true", "false", "0", "1", "0.0", "1.0"):
            raise LibraryError(
                f"{where}: success is {quoted(value)}, which must be true or false, 1 or 0"
            )
        return float(text in ("true", "1", "1.0"))
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not np.isfinite(number) and not (np.isnan(default or 0.0) and text == "nan"):
        unit = f" in {COLUMNS[name].unit}" if COLUMNS[name].unit else ""
        raise LibraryError(
            f"{where}: {name} is {quoted(value)}, which must be a finite number{unit}; correct it"
            " or leave the row out"
        )
    return number


def _check_record(row: Mapping[str, float], scenario: Scenario, where: str) -> None:
    """Refuses a record that the library's robot could not have made in its category."""
    arm = scenario.arm()
    if row["environment"] != np.round(row["environment"]) and not np.isnan(row["environment"]):
        raise LibraryError(
            f"{where}: environment is {row['environment']:g}, which must be a whole number"
        )
    for name in ("start_phi", "final_phi"):
        if abs(row[name]) > np.pi + 1e-6:
            raise LibraryError(
                f"{where}: {name} is {row[name]:g} rad, which must be from -3.1416 to 3.1416;"
                " directions are in radians, not degrees"
            )
    p_WR = np.array([row["base_x"], row["base_y"], 0.0])
    torso = None if isinstance(arm, PlanarArm) else row["torso"]
    try:
        check_goal(scenario, np.array([row[f"goal_{a}"] for a in "xyz"]) - p_WR, torso)
    except RequestError as error:
        raise LibraryError(f"{where}: {error}, or leave the row out") from None
    if isinstance(arm, PlanarArm):
        _check_planar_start(row, scenario, where)
    elif abs(np.linalg.norm([row[f"start_q{a}"] for a in "wxyz"]) - 1.0) > 1e-3:
        raise LibraryError(
            f"{where}: the quaternion start_qw, start_qx, start_qy, start_qz must have length 1"
            " within 0.001; divide it by its length"
        )


def _check_planar_start(row: Mapping[str, float], scenario: Scenario, where: str) -> None:
    line = scenario.task.start_line
    x_m, y_m = row["start_x"] - row["base_x"], row["start_y"] - row["base_y"]
    for name, value, low, high in (
        ("start_x", x_m, line.x_m, line.x_m),
        ("start_y", y_m, line.y_min_m, line.y_max_m),
    ):
        if not low - START_TOLERANCE_M <= value <= high + START_TOLERANCE_M:
            raise LibraryError(
                f"{where}: {name} is {value:g} m from the base, which must be from"
                f" {low - START_TOLERANCE_M:g} to {high + START_TOLERANCE_M:g} m: the hand starts"
                f" on the start line of {scenario.category}; leave the row out"
            )


def _numbered(environment: Vector) -> NDArray[np.int64]:
    """Returns environments as whole numbers; rows without one get numbers that no other has."""
    unknown = np.isnan(environment)
    first = 0 if np.all(unknown) else int(np.max(environment[~unknown])) + 1
    numbers = environment.copy()
    numbers[unknown] = first + np.arange(np.sum(unknown))
    return numbers.astype(np.int64)
