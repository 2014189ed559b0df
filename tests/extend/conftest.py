"""The user's own files in notebooks/extend, imported without leaving traces for other tests."""

import os
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

EXTEND = Path(__file__).resolve().parents[2] / "notebooks" / "extend"
NAMES = ("shelf", "long_arm", "boosting")


@pytest.fixture
def extend(
    registries_restored: None, monkeypatch: pytest.MonkeyPatch
) -> Iterator[dict[str, ModuleType]]:
    """The modules by name, registered until the end of the test."""
    monkeypatch.syspath_prepend(EXTEND)
    yield {name: import_module(name) for name in NAMES}
    for name in NAMES:
        del sys.modules[name]


@pytest.fixture
def environment() -> dict[str, str]:
    """Environment variables with which the command line knows them."""
    path = os.pathsep.join([str(EXTEND), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, "LIC_EXTENSIONS": ",".join(NAMES)}
