"""How a collection shows its progress: a bar in a terminal, a line a minute in a log."""

import sys
from typing import TYPE_CHECKING, Self, TextIO

if TYPE_CHECKING:
    from lic_drake.experience.runner import Progress

LOG_EVERY_S = 60.0
"""Time between two lines in a log, seconds."""


class ProgressDisplay:
    """A context manager; `show` takes the progress as often as there is any.

    Args:
        log: Where lines go when there is no terminal for a bar; by default the standard output.
    """

    def __init__(self, log: TextIO | None = None) -> None:
        from tqdm import tqdm

        # None: off where the output is no terminal.
        self._bar = tqdm(disable=None, bar_format="{percentage:3.0f}%|{bar}{postfix}")
        self._log = log
        self._next_line_s = LOG_EVERY_S

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._bar.close()

    def show(self, progress: "Progress") -> None:
        """Shows how far the collection is."""
        if not self._bar.disable:
            self._bar.total, self._bar.n = progress.total, progress.done
            self._bar.set_postfix_str(progress.describe())
        elif progress.elapsed_s >= self._next_line_s:
            print(progress.describe(), file=self._log or sys.stdout, flush=True)
            self._next_line_s = progress.elapsed_s + LOG_EVERY_S
