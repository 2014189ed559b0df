"""What the registries of categories, features, robots and estimators share."""

from lic_drake.errors import LicError


def add_entry[T](
    known: dict[str, T], kind: str, name: str, entry: T, error: type[LicError]
) -> None:
    """Adds an entry to a registry.

    An entry may be registered again by the code that made it before, as a notebook cell does that
    is run twice; nobody else may take its name.

    Args:
        known: The registry, changed in place.
        kind: What it holds, for messages.
        name: The new entry's name.
        entry: The entry.
        error: What to raise.

    Raises:
        LicError: The name is not a plain word, or belongs to another entry.
    """
    if not isinstance(name, str) or not name.replace("-", "").replace("_", "").isalnum():
        raise error(
            f"{name!r} cannot be the name of a {kind}; use letters, digits, hyphens and underscores"
        )
    if name in known and _origin(known[name]) != _origin(entry):
        raise error(
            f"the {kind} {name!r} is known already, from {'.'.join(_origin(known[name]))};"
            " choose another name"
        )
    known[name] = entry


def _origin(entry: object) -> tuple[str, str]:
    """Returns module and name of the class or function that an entry is or was made by."""
    maker = entry if hasattr(entry, "__qualname__") else type(entry)
    return str(maker.__module__), str(getattr(maker, "__qualname__", maker))
