"""Exceptions for user errors, printed as one line by the command line, and remarks to users."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class LicError(Exception):
    """Base class; messages name the value, the limit and the remedy."""


class ScenarioError(LicError):
    """A scenario file or one of its values is invalid."""


class RequestError(LicError):
    """A requested reach is impossible (unreachable goal, infeasible start, NaN)."""


class LibraryError(LicError):
    """An experience library cannot be read or written."""


class EstimateError(LicError):
    """An estimator is unknown, not fitted, or was given invalid rows."""


class ClusterError(LicError):
    """A cluster is unreachable, or its workers are incompatible."""


class RenderingError(LicError):
    """Cameras cannot be simulated on this machine."""


class ModelError(LicError):
    """A robot model or its meshes could not be found or loaded."""


class PerceptionError(LicError):
    """The board, an aperture or the goal was not found in the images."""


def quoted(value: object) -> str:
    """Returns a value from a file for a message, printable and truncated to 40 characters."""
    text = str(value)
    short = text if len(text) <= 40 else f"{text[:40]}..."
    return short if short.isprintable() else ascii(short)


@contextmanager
def readable_errors(path: Path, action: str) -> Iterator[None]:
    """Turns system errors of an action on a path, such as "write", into a `LibraryError`."""
    try:
        yield
    except OSError as error:
        raise LibraryError(
            f"cannot {action} {path}: {error.strerror or error}; check free space and permissions"
        ) from error


def check_writable(folder: Path) -> None:
    """Creates a folder; raises a `LibraryError` unless it is writable."""
    with readable_errors(folder, "write into"):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()


def remark(line: str) -> None:
    """Prints a line on the standard error, which keeps progress apart from results."""
    print(line, file=sys.stderr, flush=True)
