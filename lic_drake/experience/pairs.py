"""The library D2 of second reaches (paper III-C), built from single reaches."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError

SHOWN = (
    *("start_x", "start_y", "start_phi", "final_x", "final_y", "final_phi", "final_vx", "final_vy"),
    *("start_z", "start_qx", "final_z", "final_vz"),
)
"""Columns that a robot can observe of a failed reach: x0', x_inf' and the final velocity."""

FIRST_PREFIX = "first_"
"""Prefix of these columns for the first reach of a pair."""

_SAME_TASK = ("stream", "environment", "goal_x", "goal_y", "goal_z")


def pair_reaches(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Returns D2: each failed reach paired with every reach of the same environment and goal.

    The paper assumes that a reach leaves its environment unchanged, so that a failed reach and any
    reach to the same goal in the same environment form a first and a second attempt. The second
    reach is "from all of the reach attempts, whether they resulted in failure or not"; all pairs
    are used, including that of a failed reach with itself. A reach that never began (its final
    pose is NaN) is the first of no pair.

    Args:
        columns: D1: arrays of shape (n,) named as the fields of `ReachRecord`.

    Returns:
        The columns of the second reach, and those of `SHOWN` of the first, with `FIRST_PREFIX`.
        Pairs are grouped by first reach, in the order of D1.
    """
    for name in (*_SAME_TASK, *SHOWN, "success"):
        if name not in columns:
            raise LibraryError(f"the library has no column {name!r}, which D2 requires")
    codes = [np.unique(columns[name], return_inverse=True)[1] for name in _SAME_TASK]
    task = np.unique(np.column_stack(codes), axis=0, return_inverse=True)[1].ravel()
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
