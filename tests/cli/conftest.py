"""Makes the module `fake_reach` importable, and a library that it filled."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fake_reach import fill_library


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Folder of a complete library: 3 environments x 4 goals x 3 starts."""
    return fill_library(tmp_path / "library")
