"""A new library, and reaches without a simulator, in this process or in others."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.collecting import Start, collections
from support.fake_reach import FakeReach

from lic_drake.experience.store import ExperienceLibrary


@pytest.fixture
def library(tmp_path: Path) -> ExperienceLibrary:
    return ExperienceLibrary(tmp_path / "library")


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


@pytest.fixture
def start() -> Iterator[Start]:
    with collections() as start:
        yield start
