"""The exceptions that a user may cause; the command line prints them as one line."""


class LicError(Exception):
    """Base class: something the user gave or asked for cannot be used as it is.

    The message names the value, the limit, and what to do.
    """


class ScenarioError(LicError):
    """A scenario file or one of its values is unusable."""


class RequestError(LicError):
    """A reach was asked for that cannot be made (goal out of reach, bad start pose, NaN)."""


class LibraryError(LicError):
    """An experience library cannot be read or written."""


class EstimateError(LicError):
    """An estimator is unknown, not fitted yet, or was given unusable rows."""


class ClusterError(LicError):
    """A cluster cannot be reached, or its workers cannot be used as they are."""


class RenderingError(LicError):
    """Cameras cannot be simulated on this machine as it is."""


class ModelError(LicError):
    """A description of a robot, or its meshes, cannot be had."""


class PerceptionError(LicError):
    """What was looked for cannot be found in the images."""


def quoted(value: object) -> str:
    """Returns what a file says for a message: on one line, and not longer than is useful."""
    text = str(value)
    short = text if len(text) <= 40 else f"{text[:40]}..."
    return short if short.isprintable() else ascii(short)
