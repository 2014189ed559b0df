"""A library that `fake_reach` filled."""

from pathlib import Path

import pytest
from support.fake_reach import fill_library

from lic_drake.experience.workers import Workers


@pytest.fixture
def _here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands do in this process what they would do in workers, which take seconds to start."""
    monkeypatch.setattr("lic_drake.experience.workers.LocalWorkers", lambda count: Workers())


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Folder of a complete library: 3 environments x 4 goals x 3 starts."""
    return fill_library(tmp_path / "library")
