"""How much quicker an estimator goes on learning than it begins again."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from time import process_time

import numpy as np

from lic_drake.estimate.averaging import AveragedRows, average_rows
from lic_drake.estimate.features import ExperienceRows
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.posterior import condition
from lic_drake.evaluate.table import Table


@dataclass(frozen=True, kw_only=True)
class UpdateTime:
    """How long a Gaussian process takes to learn from added records.

    Attributes:
        records: Number of records.
        fit_s: Fitting all rows anew, hyper-parameters included, seconds.
        condition_s: Conditioning on all rows with the hyper-parameters kept, seconds.
        update_s: Taking the records in, seconds.
        difference: Largest difference of the last two's estimates at all rows.
    """

    records: int
    fit_s: float
    condition_s: float
    update_s: float
    difference: float


def time_update(rows: ExperienceRows, added: ExperienceRows) -> UpdateTime:
    """Times a Gaussian process that goes on learning against one that begins again.

    Processor time of this process, which runs linear algebra on one thread; the shortest of three.
    """
    process = GaussianProcess().fit(rows.Z, rows.f, rows.environment)
    environment = np.concatenate([rows.environment, added.environment + 1 + rows.environment.max()])
    Z, f = np.vstack([rows.Z, added.Z]), np.concatenate([rows.f, added.f])
    weight = np.broadcast_to(added.weight, len(added.f))
    fit_s, _ = _shortest(lambda: GaussianProcess().fit(Z, f, environment), 1)
    condition_s, whole = _shortest(
        lambda: condition(
            _side_by_side(average_rows(rows.Z, rows.f), average_rows(added.Z, added.f, weight)),
            process.hyperparameters,
        )
    )
    update_s, updated = _shortest(lambda: copy(process).update(added.Z, added.f, added.weight))
    return UpdateTime(
        records=len(added.f),
        fit_s=fit_s,
        condition_s=condition_s,
        update_s=update_s,
        difference=float(np.abs(whole.mean(Z) - updated.values(Z)).max()),
    )


def update_table(times: Sequence[UpdateTime], reaches: int) -> Table:
    """Returns the times by the number of records.

    Args:
        times: See `time_update`.
        reaches: Number of simulated reaches that the process knows before.
    """
    return Table(
        caption=f"A Gaussian process of {reaches} simulated reaches takes in real records.",
        heading=(
            *("real records", "update, s", "posterior of all rows, s"),
            *("fit of all rows, hyper-parameters too, s", "update against posterior, largest"),
        ),
        rows=tuple(
            (
                *(str(time.records), f"{time.update_s:.3f}", f"{time.condition_s:.3f}"),
                *(f"{time.fit_s:.1f}", f"{time.difference:.0e}"),
            )
            for time in times
        ),
    )


def _side_by_side(a: AveragedRows, b: AveragedRows) -> AveragedRows:
    """Returns rows followed by others, equal ones not averaged."""
    return AveragedRows(
        Z=np.vstack([a.Z, b.Z]),
        rate=np.concatenate([a.rate, b.rate]),
        count=np.concatenate([a.count, b.count]),
        member=np.concatenate([a.member, len(a.Z) + b.member]),
    )


def _shortest[T](work: Callable[[], T], times: int = 3) -> tuple[float, T]:
    """Returns the shortest processor time of some runs, seconds, and the last result."""
    durations = []
    for _ in range(times):
        began = process_time()
        result = work()
        durations.append(process_time() - began)
    return min(durations), result
