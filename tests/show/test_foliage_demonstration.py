"""The sequence of Fig. 2: look, select, reach, look again; its experience is made up."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record

from lic_drake.evaluate.experiment import Evaluation, run_evaluation
from lic_drake.experience.grid import REQUEST_FILE, CollectionRequest, write_request
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.perception.config import CamerasConfig, load_cameras
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.start import Start
from lic_drake.show.demonstration import demonstrate

SHORT = "{stop: {timeout_s: 0.2}, clutter: {num_stems: 3, num_branches: 1}}"

pytestmark = pytest.mark.usefixtures("_renderer")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("foliage-aperture-clutter", SHORT)


@pytest.fixture(scope="module")
def cameras_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped cameras with a quarter of the pixels."""
    path = tmp_path_factory.mktemp("cameras") / "small.yaml"
    small = "{camera: {width: 320, height: 240, focal_px: 262.5}}"
    path.write_text(f"head: {small}\nexternal: {small}\n")
    return path


@pytest.fixture(scope="module")
def cameras(cameras_file: Path) -> CamerasConfig:
    return load_cameras(cameras_file)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    """Made up: reaches among spheres, those from apertures near the goal succeed."""
    spheres = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    library = ExperienceLibrary(tmp_path_factory.mktemp("spheres"))
    request = CollectionRequest(scenario=spheres, environments=4, max_goals=4)
    for environment in request.environment_indices:
        records = []
        for item in request.reaches(environment):
            apart = np.hypot(item.start.x0[1] - item.goal[1], item.start.x0[2] - item.goal[2])
            records.append(replace(make_record(item), success=bool(apart < 0.2)))
        library.write_shard(f"training-{environment:06d}", records, spheres)
    write_request(request, library.path / REQUEST_FILE)
    return library


def test_the_robot_looks_before_every_attempt_and_shows_it(
    library: ExperienceLibrary,
    scenario: Scenario,
    cameras: CamerasConfig,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("lic_drake.show.demonstration.save_stills", lambda *_: {})
    lines: list[str] = []
    result = demonstrate(scenario, library, "knn", 2, tmp_path, say=lines.append, cameras=cameras)
    assert not result.success  # In 0.2 s nobody gets anywhere.
    words = " ".join(lines)
    assert words.index("look 1:") < words.index("attempt 1:") < words.index("look 2:")
    # It reaches for where it saw the ball, not for where it is.
    goals = np.array([attempt.request.goal for attempt in result.attempts])
    off = np.linalg.norm(goals - result.p_WG, axis=1)
    assert np.all(off > 1e-4) and np.all(off < 0.05)
    assert not np.array_equal(goals[0], goals[1])
    page = result.files["sequence"].read_text(encoding="utf-8")
    for word in ("image/webp", "Look 1", "Look 2", "DecompressionStream"):
        assert word in page
    assert {"look 1", "look 2", "views", "apertures", "recording"} <= set(result.files)
    assert all(path.stat().st_size > 1000 for path in result.files.values())


def test_success_is_to_touch_the_ball(scenario: Scenario, cameras: CamerasConfig) -> None:
    p_WG = np.array([0.84, -0.1, 0.9])
    observer = Observer(
        scenario=scenario, stream="training", environment=0, p_WG=p_WG, cameras=cameras
    )
    x0 = np.array([0.5, 0.0, 0.9, 1.0, 0.0, 0.0, 0.0])
    record = make_record(
        ReachRequest(
            scenario, "training", 0, p_WG, Start(x0, np.array([0.0, 0.0, scenario.task.torso_m]))
        )
    )
    for off, success, touches in ((0.02, True, True), (0.04, True, False), (0.02, False, False)):
        end = replace(record, final_x=0.84, final_y=-0.1 + off, final_z=0.9, success=success)
        assert observer.touches_ball(end) == touches


def test_strategies_are_compared_by_what_the_cameras_see(
    library: ExperienceLibrary, scenario: Scenario, cameras_file: Path, tmp_path: Path
) -> None:
    evaluation = Evaluation(
        experience=library.path,
        results=tmp_path,
        methods=("cost",),
        environments=1,
        goals=1,
        attempts=1,
        scenario_name="foliage-aperture-clutter",
        overrides=SHORT,
        cameras=str(cameras_file),
    )
    rows = run_evaluation(evaluation)
    assert [row.method for row in rows] == ["cost"]
    (record,) = evaluation.reaches.records()
    true = scenario.sample_goal("evaluation", 0)
    assert 1e-4 < np.linalg.norm(record.p_WG - true) < 0.05
