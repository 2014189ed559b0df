"""Configurations: dataclasses whose fields are checked, and their reading from YAML."""

import dataclasses
import math
import sys
from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

import yaml

from lic_drake.errors import LicError, ScenarioError

MAX_YAML_BYTES = 1_000_000
"""Longer YAML texts are refused: none of ours has a tenth of it."""

_MAX = sys.float_info.max


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
    """Checks numeric fields of a configuration; each is a number or a list of numbers.

    Args:
        config: The configuration.
        finite: Names of fields that must be finite.
        positive: Names of fields that must be positive and finite.
        non_negative: Names of fields that must be 0 or more and finite.
        ranges: Lowest and highest allowed value, which may be infinite, by name.
        vectors: Number of components, all finite, by name.
        intervals: Names of fields that must be [least, most].
        ascending: Pairs of names; the first field must not exceed the second, in any component.
        error: What to raise.

    Raises:
        LicError: A field does not fit; the message names it, its value and the limit.
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
    """Returns the data in YAML text that must be a mapping; nothing in it is executed.

    Args:
        text: The text; empty text is an empty mapping.
        source: Where it comes from, for messages.

    Raises:
        ScenarioError: It is longer than `MAX_YAML_BYTES` or not a YAML mapping.
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


def merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Returns `base` with the values of `over` put over it, level by level."""
    merged = dict(base)
    for key, value in over.items():
        old = merged.get(key)
        both = isinstance(old, dict) and isinstance(value, dict)
        merged[key] = merge(merged[key], value) if both else value
    return merged


def read_section[T](schema: type[T], data: Any, source: str, defaults: T | None = None) -> T:
    """Fills a dataclass with Drake's typed YAML reader, which refuses unknown keys.

    Args:
        schema: The dataclass; each field needs a default.
        data: A mapping of its fields, or None for an empty one.
        source: Where the data come from, for messages.
        defaults: Values of what is left out; those of the dataclass by default.

    Raises:
        ScenarioError: A key or value that does not fit.
    """
    from pydrake.common.yaml import yaml_load_typed  # Configurations alone do not need Drake.

    if data is not None and not isinstance(data, dict):
        raise ScenarioError(f"{source} must be a YAML mapping, got {data!r}")
    try:
        # Drake's reader takes text only.
        section: T = yaml_load_typed(  # type: ignore[no-untyped-call]
            schema=schema,
            data=yaml.safe_dump(data or {}),
            defaults=schema() if defaults is None else defaults,
        )
        _check(section)
        return section
    # Drake's reader reports what does not fit the schema in these ways.
    except (
        AssertionError,
        AttributeError,
        RuntimeError,
        ScenarioError,
        TypeError,
        ValueError,
    ) as error:
        raise ScenarioError(f"{source}: {' '.join(str(error).split())}") from None


def _check(section: Any) -> None:
    """Runs the checks of a dataclass and its parts: the reader sets fields after `__init__`."""
    for item in dataclasses.fields(section):
        value = getattr(section, item.name)
        if dataclasses.is_dataclass(value):
            _check(value)
    if hasattr(section, "__post_init__"):
        section.__post_init__()
