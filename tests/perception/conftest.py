"""Makes the modules beside the rooms' folders importable; skips what cannot be rendered."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))


@pytest.fixture(scope="session")
def _renderer() -> None:
    """Tests that ask for it are skipped where the graphics libraries are missing."""
    from lic_drake.errors import RenderingError
    from lic_drake.perception.rendering import make_renderer

    try:
        make_renderer()
    except RenderingError as error:
        pytest.skip(str(error))
