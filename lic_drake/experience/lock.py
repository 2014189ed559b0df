"""One collection at a time in a library, and the sign by which it stops its workers."""

import os
from pathlib import Path
from types import TracebackType
from typing import Self

from lic_drake.errors import LibraryError
from lic_drake.experience.files import open_locked, readable_errors

LOCK_FILE = "_collecting"
"""Name of the lock in a library's folder; workers go on only while it is there.

A file, because it reaches workers of every kind of executor, also on other machines, and because
it can still be taken away when the disk is full.
"""


class CollectionLock:
    """Holds a library's lock as a context manager.

    The lock ends with the process that holds it, however that dies; a lock file that was left
    behind is taken over.
    """

    def __init__(self, library: Path) -> None:
        self._library = library
        self._path = library / LOCK_FILE

    def __enter__(self) -> Self:
        try:
            with readable_errors(self._path, "write"):
                self._file = open_locked(self._path, wait=False)
        except LibraryError as error:
            if not isinstance(error.__cause__, BlockingIOError):
                raise
            raise LibraryError(
                f"another lic collect is at work on {self._library}; wait for it or stop it"
            ) from None
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.stop_workers()
        self._file.close()

    def stop_workers(self) -> None:
        """Lets every worker stop after the reach that it is simulating."""
        self._path.unlink(missing_ok=True)


def is_going_on(library: Path) -> bool:
    """Tells a worker whether the collection still wants its results."""
    return os.path.exists(library / LOCK_FILE)
