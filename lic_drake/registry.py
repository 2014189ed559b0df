"""`Registry`: named entries from the package and from user modules."""

import os
from functools import cache
from importlib import import_module

from lic_drake.errors import LicError

VARIABLE = "LIC_EXTENSIONS"
"""Environment variable with the names of modules to import, separated by commas."""
GROUP = "lic_drake"
"""Entry points of installed packages: modules to import, see notebooks/8_extend.ipynb."""


class Registry[T]:
    """Categories, robots or estimators by name.

    A lookup first imports the entry points of installed packages and the modules in
    `LIC_EXTENSIONS`, so that the command line and worker processes know their entries, too.
    """

    def __init__(self, kind: str, error: type[LicError]) -> None:
        """Creates an empty registry of entries of a kind, named in the errors it raises."""
        self.entries: dict[str, T] = {}
        self._origins: dict[str, str] = {}
        self._kind = kind
        self._error = error

    def register(self, name: str, entry: T, made_by: object | None = None) -> None:
        """Adds an entry; the same code may register it again, as a notebook cell run twice does.

        Its origin is the class or function `made_by`, by default the entry itself or its class.

        Raises:
            LicError: The name is invalid, or taken by other code.
        """
        if not isinstance(name, str) or not name.replace("-", "").replace("_", "").isalnum():
            raise self._error(
                f"{name!r} cannot be the name of a {self._kind}; use letters, digits, '-' and '_'"
            )
        maker = entry if made_by is None else made_by
        maker = maker if hasattr(maker, "__qualname__") else type(maker)
        origin = f"{maker.__module__}.{getattr(maker, '__qualname__', maker)}"
        if name in self.entries and self._origins[name] != origin:
            raise self._error(
                f"the {self._kind} {name!r} is already registered by {self._origins[name]}; choose"
                " another name"
            )
        self.entries[name], self._origins[name] = entry, origin

    def get(self, name: str) -> T:
        """Returns the entry with this name; the registry's error if it is unknown."""
        load_extensions()
        if name not in self.entries:
            raise self._error(
                f"unknown {self._kind} {name!r}; choose one of {', '.join(self.entries)}"
            )
        return self.entries[name]

    def names(self) -> tuple[str, ...]:
        """Returns all names, in the order of registration."""
        load_extensions()
        return tuple(self.entries)


@cache
def load_extensions() -> None:
    """Imports what registers further entries, once per process; a LicError names what it cannot."""
    from importlib.metadata import entry_points

    for point in entry_points(group=GROUP):
        try:
            point.load()
        except (ImportError, AttributeError) as error:
            raise LicError(
                f"the entry point {point.name} = {point.value} of an installed package cannot be"
                f" imported ({error}); mend that package or uninstall it"
            ) from error
    for name in filter(None, map(str.strip, os.environ.get(VARIABLE, "").split(","))):
        try:
            import_module(name)
        except (ImportError, TypeError) as error:  # A relative name is a TypeError.
            raise LicError(
                f"{VARIABLE} names {name!r}, which cannot be imported ({error}); put the folder of"
                f" {name}.py on PYTHONPATH"
            ) from error
