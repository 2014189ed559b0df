"""Exceptions for user errors; the command line prints them as one line."""


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
