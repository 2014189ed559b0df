"""Demonstrations whose experience is made up."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record
from support.made_up import BRIEF, NARROW, planar_library, small_cameras, sphere_library
from support.mesh_package import write_drake_models

from lic_drake.errors import LicError, RequestError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.perception.config import load_cameras
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach
from lic_drake.reach.start import Start
from lic_drake.show.demonstration import demonstrate

pytestmark = pytest.mark.usefixtures("_coarse")

PNG = b"\x89PNG"
FOLIAGE = load_scenario(
    "foliage-aperture-clutter",
    f"{{{BRIEF}, {NARROW}, clutter: {{num_stems: 1, num_branches: 1}}}}",
)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 2.0}}")
    return planar_library(tmp_path_factory.mktemp("cylinders") / "library", scenario)


@pytest.fixture(scope="module")
def spheres(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    return sphere_library(tmp_path_factory.mktemp("spheres"))


@pytest.fixture
def _no_stills(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})


def messages_of(path: Path) -> bytes:
    """The messages that a recording holds, decoded."""
    page = path.read_text(encoding="utf-8")
    return b"".join(b64decode(text) for text in re.findall(r"base64,([\w+/]+=*)", page))


@pytest.mark.usefixtures("_no_stills")
def test_a_demonstration_writes_what_it_did_and_its_reaches_are_those_of_run_reach(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    lines: list[str] = []
    result = demonstrate(library.scenario(), library, "gp1", 3, tmp_path / "new", say=lines.append)
    for kind in ("density", "path"):
        assert result.files[kind].read_bytes().startswith(PNG)
    data = json.loads(result.files["data"].read_text(encoding="utf-8"))
    assert data["method"] == "gp1"
    assert data["success"] == result.success == result.attempts[-1].record.success
    for attempt, stored in zip(result.attempts, data["attempts"], strict=True):
        assert attempt.record == run_reach(attempt.request)
        assert stored["record"]["key"] == attempt.record.key
        assert stored["estimated_success"] == attempt.selection.probability is not None
    assert lines[0].startswith("cylinder-clutter, evaluation environment 3")


@pytest.mark.usefixtures("_no_stills")
def test_a_second_attempt_starts_elsewhere_and_the_pictures_are_the_new_ones_only(
    tmp_path: Path,
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    old = ("apertures.png", "look2.png", "attempt3_end.png", "film.webp", "mine.png")
    for name in old:  # Of a demonstration of another kind.
        (out / name).touch()
    scenario = load_scenario("cylinder-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    library = planar_library(tmp_path / "apertures", scenario)
    lines: list[str] = []
    # A baseline: the densities are those that LIC would have estimated.
    result = demonstrate(scenario, library, "rnd>cost", 1, out, say=lines.append)
    assert {path.name for path in out.iterdir()} == {
        *("demo.html", "demo.json", "density.png", "index.html", "path.png", "mine.png")
    }
    first, second = result.attempts
    assert first.record.outcome == second.record.outcome == "timeout"
    assert abs(first.selection.start.x0[1] - second.selection.start.x0[1]) > 0.1
    assert second.request.before() == first.request
    assert second.record == run_reach(second.request)
    said = [line for line in lines if "starts at y" in line]
    for attempt, line in zip(result.attempts, said, strict=True):
        assert f"base at y {attempt.selection.start.b0[1]:+.3f} m" in line


def test_a_pr2_shows_what_it_did_in_drakes_meshes(
    spheres: ExperienceLibrary, tmp_path: Path
) -> None:
    scenario = spheres.scenario("{clutter: {num_blocked: 8}}")
    lines: list[str] = []
    package = write_drake_models(tmp_path / "package")
    result = demonstrate(
        scenario, spheres, "knn", 3, tmp_path, say=lines.append, drake_models=package
    )
    assert b"_meshfile_" in messages_of(result.files["recording"])
    stills = [
        f"attempt {i} {name}" for i in (1, 2) for name in ("start", "middle", "end", "inside")
    ]
    if not any("no stills and no film: cameras cannot be simulated" in line for line in lines):
        assert [kind for kind in result.files if kind.startswith("attempt")] == stills
    for kind, path in result.files.items():
        assert kind in ("recording", "data", "film", "index") or path.read_bytes().startswith(PNG)
    assert {"apertures", "path"} < set(result.files)
    first, second = result.attempts
    assert first.record.scenario == scenario.digest
    # The meshes change nothing of the reaches.
    assert [first.record, second.record] == [run_reach(a.request) for a in (first, second)]
    assert second.request.after == (first.request.start,)
    assert lines[1].startswith("goal at (0.840,")
    assert any(re.search(r"starts at the aperture at \(0.530,.*torso at", line) for line in lines)


@pytest.mark.usefixtures("_renderer", "_coarse")
def test_before_foliage_the_robot_looks_before_every_attempt_and_shows_it(
    spheres: ExperienceLibrary, tmp_path: Path
) -> None:
    cameras = load_cameras(small_cameras(tmp_path / "small.yaml"))
    lines: list[str] = []
    result = demonstrate(FOLIAGE, spheres, "knn", 2, tmp_path, say=lines.append, cameras=cameras)
    assert not result.success  # 0.2 s are too short to get anywhere.
    words = " ".join(lines)
    assert words.index("look 1:") < words.index("attempt 1:") < words.index("look 2:")
    # It reaches for where it saw the ball, not for where it is.
    goals = np.array([attempt.request.goal for attempt in result.attempts])
    off = np.linalg.norm(goals - result.p_WG, axis=1)
    assert np.all(off > 1e-4) and np.all(off < 0.05)
    assert not np.array_equal(goals[0], goals[1])
    page = result.files["index"].read_text(encoding="utf-8")
    # It links everything that was written, and nothing else.
    names = {path.name for path in result.files.values()} - {"index.html"}
    assert set(re.findall(r'(?:href|src)="([^"]+)"', page)) == names
    assert "not reached</h1>" in page and "Attempt 2: timeout" in page
    assert {"look 1", "look 2", "film", "apertures", "recording"} <= set(result.files)
    assert all(path.stat().st_size > 1000 for path in result.files.values())


def test_with_cameras_success_is_to_touch_the_ball() -> None:
    p_WG = np.array([0.84, -0.1, 0.9])
    observer = Observer(
        scenario=FOLIAGE, stream="training", environment=0, p_WG=p_WG, cameras=load_cameras()
    )
    start = Start(np.array([0.5, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.15]))
    record = make_record(ReachRequest(FOLIAGE, "training", 0, p_WG, start))
    for off, success, touches in ((0.02, True, True), (0.04, True, False), (0.02, False, False)):
        end = replace(record, final_x=0.84, final_y=-0.1 + off, final_z=0.9, success=success)
        assert observer.touches_ball(end) == touches


def test_mistakes_are_found_before_any_work(library: ExperienceLibrary, tmp_path: Path) -> None:
    with pytest.raises(RequestError, match="unknown method"):
        demonstrate(library.scenario(), library, "svm", 0, tmp_path / "out")
    (tmp_path / "file").write_text("")
    with pytest.raises(LicError, match="cannot write into"):
        demonstrate(library.scenario(), library, "gp", 0, tmp_path / "file" / "out")
