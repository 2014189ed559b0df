"""Shared by all figures: files, colours, labels."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import LicError, readable_errors
from lic_drake.evaluate.trial import Attempt
from lic_drake.reach.request import is_within_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import FeasibleStarts, make_starts
from lic_drake.types import Vector

ATTEMPT_COLORS = ("tab:blue", "tab:purple", "tab:green", "tab:olive", "tab:cyan")
"""Colours of successive attempts, repeated if there are more."""
DOTS_PER_INCH = 150
"""Resolution of files."""


def save_figure(figure: Figure, path: Path, margins: bool = True) -> None:
    """Writes a figure, with `margins` cropped to small ones.

    The ending gives the format. Raises a LicError if the file cannot be written.
    """
    try:
        with readable_errors(path, "write"):
            figure.savefig(path, dpi=DOTS_PER_INCH, bbox_inches="tight" if margins else None)
    except ValueError as error:  # The ending is unknown.
        raise LicError(f"cannot write {path}: {error}") from None


@dataclass(frozen=True, kw_only=True)
class ShownTrial:
    """A trial and what is needed to draw it: `traces` are of its attempts, with their states."""

    scenario: Scenario
    instance: ClutterInstance
    p_WG: Vector
    attempts: Sequence[Attempt]
    traces: Sequence[ReachTrace]

    def __iter__(self) -> Iterator[tuple[Attempt, ReachTrace]]:
        """Yields attempts with their traces."""
        return iter(zip(self.attempts, self.traces, strict=True))


def attempts_figure(num_attempts: int, width: float, draw: Callable[[Axes, int], None]) -> Figure:
    """Returns a figure with a panel, `width` inches wide, for each attempt, counted from 1."""
    figure = Figure(figsize=(width * num_attempts, 4.8), layout="constrained")
    for i, ax in enumerate(figure.subplots(1, num_attempts, squeeze=False)[0]):
        draw(ax, i + 1)
    return figure


def situation_before(attempts: Sequence[Attempt], number: int, starts: FeasibleStarts) -> Situation:
    """Returns the situation in which an attempt, from 1, was selected from feasible starts."""
    failed = tuple(FailedReach.from_record(attempt.record) for attempt in attempts[: number - 1])
    return Situation(p_WG=attempts[number - 1].request.goal, starts=starts, failed=failed)


def estimate_title(selector: LicSelector, number: int, attempt: Attempt) -> str:
    """Returns the title of an attempt's panel: its number, from 1, the model and the outcome."""
    model = 1 if selector.second is None else min(number, 2)
    outcome = attempt.record.outcome
    return f"attempt {number}, LIC-{model} ({selector.method}): {outcome}"


def is_reachable(scenario: Scenario, stream: str, environment: int, p_WG: Vector) -> bool:
    """Returns whether the arm is long enough for a goal from one of the feasible bases."""
    starts = make_starts(scenario, scenario.sample_instance(stream, environment))
    return any(is_within_reach(scenario, p_WG - b0) for b0 in np.unique(starts.grid.b0, axis=0))
