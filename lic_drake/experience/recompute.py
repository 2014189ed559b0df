"""Simulates rows of a library again and compares: a record is a function of its request."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from lic_drake.errors import LibraryError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.task import ReachFunction, simulate
from lic_drake.reach.request import ReachRecord, ReachRequest

NOT_COMPARED = ("wall_time_s", "lic_drake_version", "drake_version")
"""What a repetition may change without being another reach."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """A row that came out otherwise.

    Attributes:
        key: Its key.
        fields: Names of the fields that differ in any bit.
        outcomes: Outcome in the library, and of the repetition.
    """

    key: str
    fields: tuple[str, ...]
    outcomes: tuple[str, str]


def recompute(
    library: ExperienceLibrary,
    count: int,
    rng: np.random.Generator,
    *,
    reach: ReachFunction = simulate,
    progress: Callable[[int], None] | None = None,
) -> list[Difference]:
    """Simulates random rows of a library again.

    Equality to the last bit may be asked for on the machine that collected the library: other
    processors round otherwise, and contact makes much of little.

    Args:
        library: The library.
        count: Number of rows to draw, at most those of the library.
        rng: Draws them, without replacement.
        reach: Simulates a request.
        progress: Is called after each row with the number of rows done.

    Returns:
        The rows that differ, environment by environment.

    Raises:
        LibraryError: The library is empty or has fewer rows than asked for.
    """
    scenario, rows = library.scenario(), library.records()
    if count > len(rows):
        raise LibraryError(f"{library.path} has {len(rows)} rows, fewer than {count}; ask for less")
    picked = [rows[i] for i in rng.choice(len(rows), count, replace=False)]
    # An environment's diagrams are built once.
    picked.sort(key=lambda row: (row.stream, row.environment))
    differing: list[Difference] = []
    for done, row in enumerate(picked, start=1):
        again = reach(ReachRequest.from_record(row, scenario))
        names = _differing_fields(row, again)
        if names:
            outcomes = (row.outcome, again.outcome)
            differing.append(Difference(key=row.key, fields=names, outcomes=outcomes))
        if progress is not None:
            progress(done)
    return differing


def _differing_fields(row: ReachRecord, again: ReachRecord) -> tuple[str, ...]:
    names = [f.name for f in fields(ReachRecord) if f.name not in NOT_COMPARED]
    return tuple(n for n in names if not _is_same(getattr(row, n), getattr(again, n)))


def _is_same(a: object, b: object) -> bool:
    """Compares values of which NaN equals itself."""
    both_nan = isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b)
    return both_nan or a == b
