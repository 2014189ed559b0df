import base64
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record, make_request

from lic_drake.errors import LicError, RequestError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.show import demonstration
from lic_drake.show.demonstration import demonstrate

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def library() -> ExperienceLibrary:
    return ExperienceLibrary(shipped_library("cylinder-clutter"))


@pytest.fixture(scope="module")
def small_library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    """Made-up experience with short reaches, so that every attempt fails."""
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.2}}")
    return _made_up(tmp_path_factory.mktemp("small"), scenario)


@pytest.fixture(scope="module")
def long_library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    """Made-up experience with the reaches of the shipped scenario."""
    return _made_up(tmp_path_factory.mktemp("long"), load_scenario("cylinder-clutter"))


@pytest.fixture(scope="module")
def aperture_library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    scenario = load_scenario("cylinder-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    return _made_up(tmp_path_factory.mktemp("apertures"), scenario)


@pytest.fixture(autouse=True)
def _no_stills(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stills take longer than what is tested here; test_pr2_demonstration has some."""
    monkeypatch.setattr(demonstration, "save_stills", lambda *args: {})


def _made_up(path: Path, scenario: Scenario) -> ExperienceLibrary:
    library = ExperienceLibrary(path)
    request = make_request(scenario=scenario, max_starts=None)
    for environment in request.environment_indices:
        records = [
            replace(make_record(item), success=item.start.x0[1] > item.start.b0[1])
            for item in request.reaches(environment)
        ]
        library.write_shard(f"training-{environment}", records, scenario)
    return library


@pytest.mark.parametrize("method", ["gp", "rnd"])
def test_demonstration_writes_what_it_did_and_the_reaches_are_those_of_run_reach(
    request: pytest.FixtureRequest, tmp_path: Path, method: str
) -> None:
    library = request.getfixturevalue("library" if method == "gp" else "long_library")
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


def test_second_attempt_starts_elsewhere_and_finds_what_the_first_left(
    small_library: ExperienceLibrary, tmp_path: Path
) -> None:
    old = ("density.png", "apertures.png", "look2.png", "views.webp", "sequence.html", "mine.png")
    for name in old:  # Of a demonstration of another kind.
        (tmp_path / name).touch()
    result = demonstrate(
        small_library.scenario(), small_library, "knn1", 3, tmp_path, say=lambda line: None
    )
    assert {path.name for path in tmp_path.iterdir()} == {
        *("demo.html", "demo.json", "density.png", "path.png", "mine.png")
    }
    first, second = result.attempts
    assert first.record.outcome == second.record.outcome == "timeout"
    assert abs(first.selection.start.x0[1] - second.selection.start.x0[1]) > 0.1
    assert not np.isnan(second.record.min_distance)
    assert first.request.after == ()
    assert second.request.before() == first.request
    assert second.record == run_reach(second.request)


@pytest.mark.parametrize("method", ["gp1", "rnd>cost"])
def test_a_demonstration_at_apertures_says_where_the_base_stands(
    aperture_library: ExperienceLibrary, tmp_path: Path, method: str
) -> None:
    lines: list[str] = []
    scenario = aperture_library.scenario()
    result = demonstrate(scenario, aperture_library, method, 1, tmp_path, say=lines.append)
    assert len(result.attempts) == 2
    said = [line for line in lines if "starts at y" in line]
    for attempt, line in zip(result.attempts, said, strict=True):
        assert f"base at y {attempt.selection.start.b0[1]:+.3f} m" in line
        assert (attempt.record.base_x, attempt.record.base_y) == tuple(
            attempt.selection.start.b0[:2]
        )
        assert attempt.record == run_reach(attempt.request)
    # From somewhere on the track the goal is near enough.
    nearest = result.p_WG - [0.0, np.clip(result.p_WG[1], -0.6, 0.6), 0.0]
    assert np.linalg.norm(nearest) < 0.833
    for kind in ("density", "path"):
        assert result.files[kind].read_bytes().startswith(PNG)
    assert b"base_track" in _messages(result.files["recording"])
    data = json.loads(result.files["data"].read_text(encoding="utf-8"))
    assert [a["record"]["base_y"] for a in data["attempts"]] == [
        a.record.base_y for a in result.attempts
    ]


def _messages(path: Path) -> bytes:
    """The messages that a recording holds, decoded."""
    html = path.read_text(encoding="utf-8")
    return b"".join(base64.b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", html))


def test_mistakes_are_found_before_any_work(library: ExperienceLibrary, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="unknown method"):
        demonstrate(library.scenario(), library, "svm", 0, tmp_path / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(LicError, match="cannot write into"):
        demonstrate(library.scenario(), library, "gp", 0, tmp_path / "file" / "out")
