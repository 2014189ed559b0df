"""The library D2 of second reaches, made from the single reaches of D1 (paper III-C).

The paper assumes that a reach leaves its environment as it was. A failed reach and any reach to
the same goal in the same environment are then a first and a second attempt.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError

SHOWN = (
    "start_x",
    "start_y",
    "start_phi",
    "final_x",
    "final_y",
    "final_phi",
    "final_vx",
    "final_vy",
    "start_z",
    "start_qx",
    "final_z",
    "final_vz",
)
"""Columns of a reach that a robot knows when it has failed: x0', x_inf' and the final velocity."""

FIRST_PREFIX = "first_"
"""What the names of these columns begin with where they belong to the first reach of a pair."""

_SAME_TASK = ("stream", "environment", "goal_x", "goal_y", "goal_z")


def pair_reaches(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Returns D2: each failed reach followed by each reach of its environment and goal.

    The paper draws the second reach "from all of the reach attempts, whether they resulted in
    failure or not" and uses all pairs instead of drawing; so a reach also follows itself, and
    fails again. A reach that never began (its final pose is NaN) showed nothing, and is the first
    of no pair.

    Args:
        columns: D1: arrays of equal length named as the fields of `ReachRecord`.

    Returns:
        The columns of the second reach, and of the first those of `SHOWN`, with `FIRST_PREFIX`
        before their names. The pairs of a first reach stand together, in the order of D1.

    Raises:
        LibraryError: A column is missing.
    """
    missing = [name for name in (*_SAME_TASK, *SHOWN, "success") if name not in columns]
    if missing:
        raise LibraryError(f"the library has no column {missing[0]!r}, which D2 is made from")
    task = _task_of_each(columns)
    members = np.argsort(task, kind="stable")
    num_members = np.bincount(task)
    offset = np.cumsum(num_members) - num_members

    known = np.isfinite(np.column_stack([columns[name].astype(float) for name in SHOWN]))
    failed = np.flatnonzero(~columns["success"].astype(bool) & known.all(axis=1))
    repeats = num_members[task[failed]]
    first = np.repeat(failed, repeats)
    rank = np.arange(len(first)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    second = members[offset[task[first]] + rank]
    pairs = {name: values[second] for name, values in columns.items()}
    return pairs | {FIRST_PREFIX + name: columns[name][first] for name in SHOWN}


def _task_of_each(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.intp]:
    """Returns a number for each row that rows of the same environment and goal share."""
    codes = [np.unique(columns[name], return_inverse=True)[1] for name in _SAME_TASK]
    _, task = np.unique(np.column_stack(codes), axis=0, return_inverse=True)
    return task.ravel()
