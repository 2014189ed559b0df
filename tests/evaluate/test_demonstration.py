import json
from pathlib import Path

import numpy as np
import pytest

from lic_drake.errors import LicError, RequestError
from lic_drake.evaluate.demonstration import demonstrate
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.rollout import run_reach

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def library() -> ExperienceLibrary:
    return ExperienceLibrary(shipped_library("cylinder-clutter"))


@pytest.mark.parametrize("method", ["gp", "rnd"])
def test_demonstration_writes_what_it_did_and_the_reaches_are_those_of_run_reach(
    library: ExperienceLibrary, tmp_path: Path, method: str
) -> None:
    lines: list[str] = []
    result = demonstrate(library.scenario(), library, method, 3, tmp_path / "new", say=lines.append)
    for kind in ("density", "path"):
        assert result.files[kind].read_bytes().startswith(PNG)
    assert "<html" in result.files["recording"].read_text(encoding="utf-8")[:1000].lower()
    data = json.loads(result.files["data"].read_text(encoding="utf-8"))
    assert data["method"] == method
    assert len(data["attempts"]) == len(result.attempts)
    assert data["success"] == result.attempts[-1].record.success
    for attempt, stored in zip(result.attempts, data["attempts"], strict=True):
        assert attempt.record == run_reach(attempt.request)
        assert stored["record"]["key"] == attempt.record.key
        assert (stored["estimated_success"] is None) == (method == "rnd")
    assert lines[0].startswith("cylinder-clutter, evaluation environment 3")


def test_second_attempt_starts_elsewhere(library: ExperienceLibrary, tmp_path: Path) -> None:
    scenario = library.scenario()
    scenario.stop.timeout_s = 0.2
    result = demonstrate(scenario, library, "knn", 3, tmp_path, say=lambda line: None)
    first, second = result.attempts
    assert first.record.outcome == second.record.outcome == "timeout"
    assert abs(first.selection.x0[1] - second.selection.x0[1]) > 0.1
    assert not np.isnan(second.record.min_distance)


def test_mistakes_are_found_before_any_work(library: ExperienceLibrary, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="unknown method"):
        demonstrate(library.scenario(), library, "svm", 0, tmp_path / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(LicError, match="cannot write into"):
        demonstrate(library.scenario(), library, "gp", 0, tmp_path / "file" / "out")
