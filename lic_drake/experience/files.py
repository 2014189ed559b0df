"""Atomic file writes, and system errors as one clear line."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lic_drake.errors import LibraryError


@contextmanager
def readable_errors(path: Path, action: str) -> Iterator[None]:
    """Turns system errors (no permission, disk full) into a `LibraryError`.

    Args:
        path: The file or folder concerned.
        action: What the block does to it, for instance "write".
    """
    try:
        yield
    except OSError as error:
        raise LibraryError(
            f"cannot {action} {path}: {error.strerror or error}; check free space and permissions"
        ) from error


def check_writable(folder: Path) -> None:
    """Creates a folder and checks that it is writable, before any work starts.

    Raises:
        LibraryError: It is not.
    """
    with readable_errors(folder, "write into"):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Writes a file so that readers see either the old or the new one, never a part.

    Args:
        path: The file, in an existing folder.
        write: Writes the content to the path that it is given.

    Raises:
        LibraryError: Writing failed; the folder is unchanged.
    """
    # The name is fixed so that the next writer overwrites what a killed one left behind. Parquet
    # readers skip names that begin with a dot or an underscore.
    temporary = path.with_name(f".{path.name}.tmp")
    with readable_errors(path, "write"):
        try:
            write(temporary)
            _sync(temporary)
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        _sync(path.parent)


def _sync(path: Path) -> None:
    """Flushes a file or directory entry to disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
