"""A table of attempts at any task, made by anybody, as rows to learn from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.types as kinds

from lic_drake.errors import EstimateError, RequestError, quoted
from lic_drake.estimate.episodes import is_data_set, read_episodes
from lic_drake.estimate.features import ExperienceRows
from lic_drake.experience.add import read_table
from lic_drake.types import IntVector, Vector

_MARGIN = 0.05
"""Share of a column's range by which a situation may be outside it."""


@dataclass(frozen=True, kw_only=True)
class Rollouts:
    """Attempts: what was given, what was decided, whether it succeeded.

    Attributes:
        given: Columns of the situation, which come first in the rows' X.
        decide: Columns of the decision, which come last.
        rows: Arguments of `SuccessEstimator.fit`, n rows.
    """

    given: tuple[str, ...]
    decide: tuple[str, ...]
    rows: ExperienceRows

    @property
    def situations(self) -> Vector:
        """What was given, shape (n, number of columns)."""
        return self.rows.X[:, : len(self.given)]

    @property
    def decisions(self) -> Vector:
        """What was decided, shape (n, number of columns)."""
        return self.rows.X[:, len(self.given) :]

    @property
    def num_groups(self) -> int:
        """How many groups there are."""
        return len(np.unique(self.rows.groups))

    def situation(self, at: Mapping[str, float]) -> Vector:
        """Returns the values of a situation in the order of the given columns, shape (k,).

        Raises:
            RequestError: A column is missing, unknown, or more than a twentieth of its range
                outside what the table has.
        """
        given, seen = self.given, self.situations
        for name in at:
            if name not in given:
                raise RequestError(f"{quoted(name)} is not given; given are {', '.join(given)}")
        for name, low, high in zip(given, seen.min(axis=0), seen.max(axis=0), strict=True):
            if name not in at:
                raise RequestError(f"the situation lacks {name}; the table has {low:g} to {high:g}")
            if not -_MARGIN * (high - low) <= at[name] - low <= (1.0 + _MARGIN) * (high - low):
                raise RequestError(
                    f"{name} is {at[name]:g}, but the table has only {low:g} to {high:g}; ask"
                    " within that, or add rollouts"
                )
        return np.array([at[name] for name in given], dtype=np.float64)


def read_rollouts(
    table: str | Path | pa.Table,
    *,
    decide: Sequence[str],
    given: Sequence[str],
    success: str = "success",
    group: str | None = None,
) -> Rollouts:
    """Reads attempts, one a row, from a CSV or Parquet file or from a table of pyarrow.

    Args:
        table: Path or table; its other columns are ignored. A data set of LeRobot or robomimic is
            read as `lic_drake.estimate.episodes.read_episodes` says.
        decide: Columns with what was decided, numbers of any unit, taken as they are.
        given: Columns with what was known when it was decided, such as where the object is.
        success: Column with 0 or 1, or false or true.
        group: Column that is equal in attempts of one scene; None: each row is a scene of its own.

    Raises:
        LicError: The file, a column or a value is unusable; the message says what to do.
    """
    if not isinstance(table, pa.Table):
        path = Path(table)
        table = read_episodes(path) if is_data_set(path) else read_table(path)
    if not given or not decide:
        raise EstimateError("name at least one column that is given and one that is decided")
    names = [*given, *decide, success]
    if twice := {name for name in names if names.count(name) > 1}:
        raise EstimateError(
            f"column {min(twice)} is named twice; each is given, decided or the success"
        )
    for name in [*names, *([group] if group else [])]:
        if (count := table.column_names.count(name)) != 1:
            raise EstimateError(
                f"the table has {f'{count} columns' if count else 'no column'} {quoted(name)};"
                " it has"
                f" {', '.join(map(quoted, dict.fromkeys(table.column_names)))}"
            )
    X = np.column_stack([_numbers(table, name) for name in [*given, *decide]])
    y = _numbers(table, success)
    _check_outcomes(y, success)
    groups = np.arange(len(y)) if group is None else _groups(table, group)
    if len(np.unique(groups)) < 2:
        raise EstimateError(
            f"all rows are of one {group}, so nothing can be held out; add rollouts of others"
        )
    for name, column in zip([*given, *decide], X.T, strict=True):
        if name in decide and np.ptp(column) == 0.0:
            raise EstimateError(
                f"{name} is {column[0]:g} in all rows, so there is nothing to decide; omit it"
            )
    everywhere = np.ones(len(y))
    rows = ExperienceRows(X=X, y=y, groups=groups, weight=everywhere, simulated=everywhere > 0.0)
    return Rollouts(given=tuple(given), decide=tuple(decide), rows=rows)


def _numbers(table: pa.Table, name: str) -> Vector:
    """Returns a column, shape (n,), all of it finite."""
    kind = table.schema.field(name).type
    if not (kinds.is_integer(kind) or kinds.is_floating(kind) or kinds.is_boolean(kind)):
        raise EstimateError(
            f"column {name} holds {kind}, but must hold numbers; encode it as one or more"
            " numeric columns"
        )
    values = np.array(table[name].to_pylist(), dtype=np.float64)  # None becomes NaN.
    if missing := int(np.sum(~np.isfinite(values))):
        raise EstimateError(
            f"{missing} of {len(values)} rows have no finite {name}; leave those rows out, or fill"
            " them in"
        )
    return values


def _groups(table: pa.Table, name: str) -> IntVector:
    """Returns the number of each row's group, shape (n,)."""
    try:
        column = table[name].combine_chunks().dictionary_encode()
    except pa.ArrowException:
        kind = table.schema.field(name).type
        raise EstimateError(
            f"column {name} holds {kind}, which cannot name groups; use numbers or text"
        ) from None
    if column.null_count:
        raise EstimateError(
            f"{column.null_count} of {len(column)} rows have no {name}; leave those rows out, or"
            " fill them in"
        )
    return np.asarray(column.indices.to_numpy(), dtype=np.intp)


def _check_outcomes(y: Vector, name: str) -> None:
    wrong = y[(y != 0.0) & (y != 1.0)]
    if len(wrong):
        raise EstimateError(
            f"{len(wrong)} of {len(y)} rows have a {name} other than 0 and 1, such as {wrong[0]:g};"
            " write 1 for success, 0 for failure"
        )
    if np.all(y == y[:1]):
        kind = "successes" if np.any(y) else "failures"
        raise EstimateError(
            f"all {len(y)} rows are {kind}, from which nothing can be learned; add some others"
        )
