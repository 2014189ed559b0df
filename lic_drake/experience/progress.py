"""How far a collection is, and telling it to whoever wants to show it."""

import time
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
        at_work: Number of tasks that are being simulated.
        elapsed_s: Wall time of this run, seconds.
    """

    total: int
    present: int
    done: int
    successes: int
    at_work: int
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


MAX_SHARE = 0.1
"""Looking takes no more than this share of the time: a thousand journals take long to open."""

ProgressFunction = Callable[[Progress], None]
"""Is called about twice a second while a collection runs, and at its end."""


class Reporter:
    """Looks at a collection now and then, and tells it to a progress function."""

    def __init__(
        self, tell: ProgressFunction | None, look: Callable[[], Progress], period_s: float
    ) -> None:
        self._period_s = period_s
        self._tell = tell
        self._look = look
        self._next = 0.0

    def report(self) -> None:
        """Tells the present state if anybody listens and it is time."""
        if self._tell is not None and time.monotonic() >= self._next:
            began = time.monotonic()
            self._tell(self._look())
            ended = time.monotonic()
            self._next = ended + max(self._period_s, (ended - began) / MAX_SHARE)

    def finish(self) -> Progress:
        """Returns the present state and tells it in any case."""
        progress = self._look()
        if self._tell is not None:
            self._tell(progress)
        return progress
