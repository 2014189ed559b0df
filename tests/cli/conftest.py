"""A library that `fake_reach` filled."""

from pathlib import Path

import pytest
from support.fake_reach import fill_library


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Folder of a complete library: 3 environments x 4 goals x 3 starts."""
    return fill_library(tmp_path / "library")
