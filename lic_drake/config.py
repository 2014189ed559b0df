"""Configuration dataclasses: validation of fields, and reading from YAML."""

import dataclasses
import math
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import yaml

from lic_drake.errors import LicError, ScenarioError, quoted

MAX_YAML_BYTES = 1_000_000
"""Maximum size of a YAML text; ours are a tenth of it."""

_MAX = sys.float_info.max
# What Drake's reader raises for data that do not match the schema.
_SCHEMA_ERRORS = (AssertionError, AttributeError, RuntimeError, TypeError, ValueError)


def check_numbers(
    config: object,
    *,
    finite: Collection[str] = (),
    positive: Collection[str] = (),
    non_negative: Collection[str] = (),
    ranges: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    vectors: Mapping[str, int] = MappingProxyType({}),
    intervals: Collection[str] = (),
    ascending: Collection[tuple[str, str]] = (),
    error: type[LicError] = ScenarioError,
) -> None:
    """Validates numeric fields, given by name; each is a number or a list of numbers.

    Limits in `ranges` may be infinite; other numbers must be finite. `vectors` gives numbers of
    components, `intervals` fields that are [least, most], `ascending` pairs of fields of which no
    component of the first may exceed that of the second.

    Raises:
        LicError: A field is invalid; the message names it, its value and the limit.
    """
    limits: list[tuple[str, float, float, str]] = [
        *((name, -_MAX, _MAX, "a finite number") for name in finite),
        *((name, math.ulp(0.0), _MAX, "a positive number") for name in positive),
        *((name, 0.0, _MAX, "0 or a positive number") for name in non_negative),
        *((name, *ends, f"from {ends[0]:g} to {ends[1]:g}") for name, ends in ranges.items()),
    ]
    for name, length in vectors.items():
        value = getattr(config, name)
        if len(value) != length or not all(map(math.isfinite, value)):
            raise error(f"{name} must be {length} finite numbers, got {value}")
    for name in intervals:
        value = getattr(config, name)
        if len(value) != 2 or not value[0] <= value[1]:
            raise error(f"{name} must be [least, most], got {value}")
    for name, low, high, wanted in limits:
        value = getattr(config, name)
        values = value if isinstance(value, list | tuple) else [value]
        if not all(low <= number <= high for number in values):
            raise error(f"{name} must be {wanted}, got {value}")
    for first, second in ascending:
        below, above = getattr(config, first), getattr(config, second)
        pairs = zip(below, above, strict=True) if isinstance(below, list) else [(below, above)]
        if not all(low <= high for low, high in pairs):
            raise error(f"{first} must not exceed {second}, got {below} and {above}")


def read_mapping(text: str | bytes, source: str) -> dict[str, Any]:
    """Parses a YAML mapping safely; empty text is an empty mapping.

    Raises:
        ScenarioError: It is longer than `MAX_YAML_BYTES` or not a mapping; names the `source`.
    """
    if len(text) > MAX_YAML_BYTES:
        raise ScenarioError(f"{source}: YAML of {len(text)} bytes; at most {MAX_YAML_BYTES}")
    try:
        data = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ScenarioError(f"{source}: not YAML: {' '.join(str(error).split())}") from None
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ScenarioError(f"{source}: must be a YAML mapping, found {type(data).__name__}")
    return data


def read_named(name: str | Path, shipped: Path, what: str) -> bytes:
    """Returns the content of a .yaml file, or of a shipped one given by its name.

    Raises:
        ScenarioError: There is none; names `what` was sought and all that are shipped.
    """
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        path = shipped / f"{name}.yaml"
    try:
        return path.read_bytes()
    except (OSError, ValueError):  # A name with a null byte is a ValueError.
        known = ", ".join(sorted(p.stem for p in shipped.glob("*.yaml")))
        raise ScenarioError(
            f"no {what} {str(name)!r}; shipped {shipped.name}: {known}, or give a .yaml path"
        ) from None


def merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Returns `base` recursively updated with `over`."""
    merged = dict(base)
    for key, value in over.items():
        both = isinstance(merged.get(key), dict) and isinstance(value, dict)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def read_section[T](schema: type[T], data: Any, source: str, defaults: T | None = None) -> T:
    """Fills a dataclass by Drake's typed YAML reader, which rejects unknown keys.

    Each field needs a default; `defaults` replaces those of the dataclass.

    Raises:
        ScenarioError: A key or value is invalid; the message names the `source`.
    """
    from pydrake.common.yaml import yaml_load_typed  # Configurations alone do not need Drake.

    if data is not None and not isinstance(data, dict):
        raise ScenarioError(f"{source} must be a YAML mapping, got {data!r}")

    def read(values: dict[str, Any]) -> T:
        start = schema() if defaults is None else defaults
        # Drake's reader takes text only.
        text = yaml.safe_dump(values)
        section: T = yaml_load_typed(schema=schema, data=text, defaults=start)  # type: ignore[no-untyped-call]
        return section

    try:
        section = read(data or {})
        _check(section)
        return section
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from None
    except _SCHEMA_ERRORS as error:
        *path, value = _culprit(data, read)
        is_shape = isinstance(error, AssertionError)  # Its message is the value once more.
        reason = "it must be a mapping" if is_shape else " ".join(str(error).split())
        where = ": ".join([source, *path])
        raise ScenarioError(f"{where} cannot be {quoted(value)} ({reason})") from None


def _culprit(values: Any, read: Callable[[dict[str, Any]], object]) -> list[Any]:
    """Returns the keys that lead to the first value that cannot be read, and the value."""
    for key, value in values.items() if isinstance(values, dict) else ():
        try:
            read({key: value})
        except _SCHEMA_ERRORS:

            def read_below(part: dict[str, Any], key: str = key) -> object:
                return read({key: part})

            return [str(key), *_culprit(value, read_below)]
    return [values]


def _check(section: Any) -> None:
    """Runs `__post_init__` recursively, because the reader sets fields after `__init__`."""
    for item in dataclasses.fields(section):
        value = getattr(section, item.name)
        if dataclasses.is_dataclass(value):
            _check(value)
    if hasattr(section, "__post_init__"):
        section.__post_init__()
