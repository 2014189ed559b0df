"""How far a collection is, for whoever wants to show it."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Progress:
    """A collection at one moment.

    Attributes:
        total: Number of reaches that were asked for.
        present: How many of them were there before this run.
        done: How many are there now.
        successes: How many of those reached their goal.
        elapsed_s: Wall time of this run, seconds.
    """

    total: int
    present: int
    done: int
    successes: int
    elapsed_s: float

    @property
    def reaches_per_minute(self) -> float:
        """Rate of this run; 0 before its first reach."""
        return 60.0 * (self.done - self.present) / self.elapsed_s if self.elapsed_s > 0 else 0.0

    @property
    def time_left_s(self) -> float | None:
        """Expected wall time to the end, seconds; None while nothing is known."""
        rate = self.reaches_per_minute
        return 60.0 * (self.total - self.done) / rate if rate > 0 else None


ProgressFunction = Callable[[Progress], None]
"""Is called about twice a second while a collection runs, and at its end."""
