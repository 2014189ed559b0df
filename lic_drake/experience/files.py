"""Files that are either whole or absent, and system errors as one clear line."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lic_drake.errors import LibraryError


@contextmanager
def readable_errors(path: Path, action: str) -> Iterator[None]:
    """Turns system errors (no permission, disk full) into a `LibraryError` about a file.

    Args:
        path: The file or folder that the block works on.
        action: What the block does, for instance "write".
    """
    try:
        yield
    except OSError as error:
        raise LibraryError(
            f"cannot {action} {path}: {error.strerror or error}; check free space and permissions"
        ) from error


def check_writable(folder: Path) -> None:
    """Makes a folder and sees that files can be written there, before any work starts.

    Raises:
        LibraryError: The system refuses.
    """
    with readable_errors(folder, "write into"):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()


def write_atomically(path: Path, write: Callable[[Path], None]) -> None:
    """Writes a file so that readers see the old one, or the new one, and never half of it.

    Args:
        path: The file; its folder must exist.
        write: Writes the content to the path that it is given.

    Raises:
        LibraryError: The system refuses; the folder is as before.
    """
    # A fixed name: what a killed writer left behind is overwritten by the next one. Parquet
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
    """Waits until a file or a folder's list of files is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
