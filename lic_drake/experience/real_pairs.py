"""D2 from second attempts that were really made (the "straightforward approach" of paper III-C)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LibraryError
from lic_drake.experience.second_reach import FIRST_PREFIX, SHOWN

_IN_PLANE = ("start_x", "start_y", "start_phi", "base_x", "base_y")
_IN_SPACE = (
    *("start_x", "start_y", "start_z", "start_qw", "start_qx", "start_qy", "start_qz"),
    *("base_x", "base_y", "torso"),
)
"""Numbers for each earlier reach in a record's `after`: its start pose and what carried the arm."""


def pair_real_attempts(columns: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Returns D2: each second attempt of a library with the first one that went before it.

    Args:
        columns: Columns of a library that holds second attempts, whose `after` has one reach, and
            the first attempts that they came after.

    Returns:
        As `lic_drake.experience.second_reach.pair_reaches`, in the library's order.

    Raises:
        LibraryError: There is no second attempt, or one without the first attempt before it.
    """
    lengths = np.array([len(after) for after in columns["after"]], dtype=int)
    in_space = np.any(columns.get("start_qw", np.zeros(1)) != 0.0)
    start = _IN_SPACE if in_space else _IN_PLANE
    task = ("stream", "environment", "goal_x", "goal_y", "goal_z")
    first_of = {
        (*(columns[name][i] for name in task), *(float(columns[name][i]) for name in start)): i
        for i in np.flatnonzero(lengths == 0)
    }
    second = np.flatnonzero(lengths == len(start))
    if len(second) == 0:
        raise LibraryError(
            "the library holds no second attempts; scripts/second_attempts/run.py makes some"
        )
    try:
        first = np.array(
            [
                first_of[(*(columns[name][i] for name in task), *map(float, columns["after"][i]))]
                for i in second
            ]
        )
    except KeyError:
        raise LibraryError(
            "the library lacks the first attempt of a second one; collect both into one library"
        ) from None
    pairs = {name: values[second] for name, values in columns.items()}
    return pairs | {FIRST_PREFIX + name: columns[name][first] for name in SHOWN}
