"""Modules of the user's own that register categories, robots or estimators, also in workers."""

import os
from functools import cache
from importlib import import_module

from lic_drake.errors import LicError

VARIABLE = "LIC_EXTENSIONS"
"""Environment variable with the names of modules to import, separated by commas."""


@cache
def load_extensions() -> None:
    """Imports the modules that `LIC_EXTENSIONS` names, once a process.

    The registries call it before they look a name up, so that the command line and the worker
    processes, which inherit the environment, know what those modules register.

    Raises:
        LicError: A module cannot be imported.
    """
    for name in filter(None, map(str.strip, os.environ.get(VARIABLE, "").split(","))):
        try:
            import_module(name)
        except (ImportError, TypeError) as error:  # A relative name is a TypeError.
            raise LicError(
                f"{VARIABLE} names {name!r}, which cannot be imported ({error}); put the folder of"
                f" {name}.py on PYTHONPATH"
            ) from error
