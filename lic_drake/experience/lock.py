"""Who collects into a library, and the sign by which a collection stops its workers."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Self

from lic_drake.errors import LibraryError
from lic_drake.experience.files import open_locked, readable_errors
from lic_drake.experience.shard import WHOLE, Shard

LOCK_FILE = "_collecting"
"""Name of the lock in a library's folder; workers go on only while it is there.

A file, because it reaches workers of every kind of executor, also on other machines, and because
it can still be taken away when the disk is full.
"""

DOOR_FILE = "_starting"
"""Name of the lock that a collection holds while it starts."""


def lock_path(library: Path, shard: Shard) -> Path:
    """Returns the path of the lock of a share of a collection."""
    suffix = "" if shard.count == 1 else f"-{shard.index}-of-{shard.count}"
    return library / f"{LOCK_FILE}{suffix}"


def is_going_on(lock: Path) -> bool:
    """Tells a worker whether the collection that holds a lock still wants its results."""
    return os.path.exists(lock)


@contextmanager
def starting(library: Path) -> Iterator[None]:
    """Lets one collection after the other look at a library's locks and its request.

    Raises:
        LibraryError: The folder cannot be written.
    """
    path = library / DOOR_FILE
    with readable_errors(path, "write"):
        door = open_locked(path, wait=True)
    with door:
        try:
            yield
        finally:
            path.unlink(missing_ok=True)


class CollectionLock:
    """Holds the lock of a share as a context manager; enter it while `starting`.

    Shares of the same division go side by side. The lock ends with the process that holds it,
    however that dies; a lock file that was left behind is taken over.

    Attributes:
        path: The lock file.
    """

    def __init__(self, library: Path, shard: Shard = WHOLE) -> None:
        self._library = library
        self.path = lock_path(library, shard)

    def __enter__(self) -> Self:
        """Takes the lock.

        Raises:
            LibraryError: A collection is at work on some of the same environments, or the folder
                cannot be written.
        """
        ours = self.path.name.rpartition("-of-")[2]
        for path in self._library.glob(f"{LOCK_FILE}*"):
            if path.name.rpartition("-of-")[2] != ours:
                self._take(path).close()
                path.unlink(missing_ok=True)  # Left behind.
        self._file = self._take(self.path)
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop_workers()
        self._file.close()

    def stop_workers(self) -> None:
        """Lets every worker stop after the reach that it is simulating."""
        self.path.unlink(missing_ok=True)

    def _take(self, path: Path) -> BinaryIO:
        """Opens and locks a lock file that nobody else holds, and notes who we are."""
        with readable_errors(path, "write"):
            try:
                file = open_locked(path, wait=False)
            except BlockingIOError:
                raise LibraryError(
                    f"another lic collect is at work on {self._library} ({path.name} is held by"
                    f" {_read(path)}); wait for it or stop it, or give each a --shard of its own"
                ) from None
            try:
                file.truncate(0)
                file.write(f"process {os.getpid()} on {socket.gethostname()}".encode())
            except BaseException:
                file.close()
                raise
            return file


def _read(path: Path) -> str:
    """Returns a lock's note; its holder may be about to delete it."""
    try:
        return path.read_text()
    except OSError:
        return "a process that is ending"
