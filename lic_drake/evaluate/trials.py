"""The trials of an evaluation as one file with a row per attempt, and their success rates."""

import dataclasses
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

import lic_drake
from lic_drake.errors import LibraryError, readable_errors
from lic_drake.evaluate.statistics import Count, count
from lic_drake.experience.schema import opened, schema_of, write_atomically, write_table

VERSION = 1
"""Incremented with every change of the columns."""

Pair = tuple[int, int]
"""Environment and goal of a trial."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class TrialRow:
    """One attempt of a strategy at a goal.

    `variant` is "" for the standard evaluation, others denote ablations such as "fresh". Attempts
    count from 1. `key` is that of the reach in the library of reaches; `probability` is estimated
    for the selected start, NaN without an estimate; `seconds` is the wall time of the selection.
    """

    variant: str
    method: str
    environment: int
    goal: int
    attempt: int
    key: str
    success: bool
    probability: float
    seconds: float


SCHEMA = schema_of(TrialRow)
"""The columns of a file of trials."""
_METADATA = {"lic_drake.trials_version": str(VERSION), "lic_drake.version": lic_drake.__version__}


def write_trials(path: Path, rows: Sequence[TrialRow]) -> None:
    """Writes the rows as a Parquet file, atomically, creating its folder if needed."""
    table = pa.Table.from_pylist([vars(row) for row in rows], SCHEMA.with_metadata(_METADATA))
    with readable_errors(path.parent, "create the folder"):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, lambda temporary: write_table(table, temporary))


def read_trials(path: Path) -> list[TrialRow]:
    """Reads a file of trials of this version."""
    with opened(path, "delete it and evaluate again") as file:
        schema = file.schema_arrow
        version = (schema.metadata or {}).get(b"lic_drake.trials_version")
        if version != str(VERSION).encode() or not schema.equals(SCHEMA, check_metadata=False):
            raise LibraryError(
                f"{path} holds no trials of version {VERSION}, the only one that lic_drake"
                f" {lic_drake.__version__} can read; choose another file or evaluate again"
            )
        table = file.read()
    return [TrialRow(**row) for row in table.to_pylist()]


class TrialTable:
    """Trials by variant and method: sequences of attempts that end with the first success."""

    def __init__(self, rows: Iterable[TrialRow]) -> None:
        """Groups attempts into trials; those of each must be 1, 2, ... up to a success."""
        ordered = sorted(rows, key=lambda row: (row.environment, row.goal, row.attempt))
        self._trials: dict[tuple[str, str], dict[Pair, tuple[TrialRow, ...]]] = {}
        for row in ordered:
            trials = self._trials.setdefault((row.variant, row.method), {})
            earlier = trials.get((row.environment, row.goal), ())
            if row.attempt != len(earlier) + 1 or any(other.success for other in earlier):
                raise LibraryError(
                    f"attempt {row.attempt} of {_name(row.method, row.variant)} in environment"
                    f" {row.environment} at goal {row.goal} is a duplicate, has no predecessor, or"
                    " follows a success; evaluate again"
                )
            trials[row.environment, row.goal] = (*earlier, row)

    @property
    def variants(self) -> tuple[str, ...]:
        """Names of the variants, sorted."""
        return tuple(sorted({variant for variant, _ in self._trials}))

    def methods(self, variant: str = "") -> tuple[str, ...]:
        """Returns the strategies of a variant, sorted."""
        return tuple(sorted(method for v, method in self._trials if v == variant))

    def pairs(self, variant: str = "") -> list[Pair]:
        """Returns the environments and goals of a variant, which all its methods share, sorted."""
        tried = {method: set(self._trials[variant, method]) for method in self.methods(variant)}
        for method, pairs in tried.items():
            other, others = next(iter(tried.items()))
            if pairs != others:
                environment, goal = min(pairs ^ others)
                raise LibraryError(
                    f"{_name(other, variant)} and {method} were tried on different goals, such as"
                    f" goal {goal} of environment {environment}; evaluate them together"
                )
        return sorted(set().union(*tried.values()))

    def trials(self, method: str, variant: str = "") -> dict[Pair, tuple[TrialRow, ...]]:
        """Returns a method's trials by environment and goal, sorted."""
        if (variant, method) not in self._trials:
            known = ", ".join(_name(m, v) for v, m in sorted(self._trials)) or "none"
            raise LibraryError(f"no trials of {_name(method, variant)}; there are {known}")
        return self._trials[variant, method]

    def success(self, method: str, attempts: int, variant: str = "") -> NDArray[np.bool_]:
        """Returns whether each of `pairs(variant)` succeeds within some attempts, shape (n,)."""
        trials, most = self.trials(method, variant), self.max_attempts(method, variant)
        # A trial may end early in a reach that was only believed to succeed, see `Observer`.
        if most < attempts and not all(rows[-1].success for rows in trials.values()):
            raise LibraryError(
                f"{_name(method, variant)} made {most} of {attempts} attempts; evaluate with more"
                " attempts"
            )
        return np.array(
            [any(row.success for row in trials[pair][:attempts]) for pair in self.pairs(variant)]
        )

    def conditional(self, method: str, attempt: int, variant: str = "") -> Count:
        """Counts an attempt's successes among the trials that came to it."""
        trials = self.trials(method, variant).values()
        return count(np.array([r[attempt - 1].success for r in trials if len(r) >= attempt], bool))

    def max_attempts(self, method: str, variant: str = "") -> int:
        """Returns the largest number of attempts in a method's trials."""
        return max(map(len, self.trials(method, variant).values()))


def _name(method: str, variant: str) -> str:
    return f"{method} ({variant})" if variant else method
