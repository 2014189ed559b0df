"""Makes the module `fake_reach` importable, and a library that it filled."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fake_reach import make_record, make_request

from lic_drake.experience.grid import REQUEST_FILE, write_request
from lic_drake.experience.store import ExperienceLibrary


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """Folder of a complete library: 3 environments x 4 goals x 3 starts."""
    library = ExperienceLibrary(tmp_path / "library")
    request = make_request()
    for environment in request.environment_indices:
        records = [make_record(item) for item in request.reaches(environment)]
        library.write_shard(f"training-{environment:06d}", records, request.scenario)
    write_request(request, library.path / REQUEST_FILE)
    return library.path
