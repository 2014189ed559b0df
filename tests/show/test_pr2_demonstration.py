"""A PR2 selects, moves, reaches and is recorded; its experience is made up."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import make_record
from support.mesh_package import write_drake_models

from lic_drake.evaluate.experiment import Evaluation, run_evaluation
from lic_drake.experience.grid import REQUEST_FILE, CollectionRequest, write_request
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import load_scenario, parse_scenario
from lic_drake.show.demonstration import demonstrate
from lic_drake.show.pr2_meshes import read_pr2_meshes

PNG = b"\x89PNG"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    """Short reaches, so that attempts fail; made up, those from apertures near the goal succeed."""
    scenario = load_scenario("sphere-aperture-clutter", "{stop: {timeout_s: 0.2}}")
    library = ExperienceLibrary(tmp_path_factory.mktemp("spheres"))
    request = CollectionRequest(scenario=scenario, environments=4, max_goals=4)
    for environment in request.environment_indices:
        records = []
        for item in request.reaches(environment):
            apart = np.hypot(item.start.x0[1] - item.goal[1], item.start.x0[2] - item.goal[2])
            records.append(replace(make_record(item), success=bool(apart < 0.2)))
        library.write_shard(f"training-{environment:06d}", records, scenario)
    write_request(request, library.path / REQUEST_FILE)
    return library


def test_a_pr2_shows_what_it_did_and_its_reaches_are_those_of_run_reach(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    scenario = parse_scenario(scenario_text(library.scenario()), "{clutter: {num_blocked: 8}}")
    lines: list[str] = []
    # What the robot looks like changes nothing of its reaches.
    meshes = read_pr2_meshes(write_drake_models(tmp_path / "package"))
    result = demonstrate(scenario, library, "knn", 3, tmp_path, say=lines.append, meshes=meshes)
    content = result.files["recording"].read_text(encoding="utf-8")
    assert "_meshfile_" in "".join(
        b64decode(text).decode("latin-1") for text in re.findall(r"base64,([\w+/]+=*)", content)
    )
    stills = [
        f"attempt {i} {name}" for i in (1, 2) for name in ("start", "middle", "end", "inside")
    ]
    if not any("no stills: cameras cannot be simulated" in line for line in lines):
        assert [kind for kind in result.files if kind.startswith("attempt")] == stills
        assert all(result.files[kind].read_bytes().startswith(PNG) for kind in stills)
    for kind in ("apertures", "path"):
        assert result.files[kind].read_bytes().startswith(PNG)
    assert "<html" in result.files["recording"].read_text(encoding="utf-8")[:1000].lower()
    data = json.loads(result.files["data"].read_text(encoding="utf-8"))
    assert [attempt["record"]["outcome"] for attempt in data["attempts"]] == ["timeout", "timeout"]
    first, second = result.attempts
    assert first.record == run_reach(first.request)
    assert second.record == run_reach(second.request)
    assert first.record.scenario == scenario.digest
    assert second.request.after == (first.request.start,)
    assert lines[0].startswith("sphere-aperture-clutter, evaluation environment 3: goal at (0.840,")
    assert "starts at the aperture at (0.530," in lines[1]
    assert "torso at" in lines[1]


def test_an_evaluation_may_block_apertures_and_keep_the_robot_where_it_is(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    evaluation = Evaluation(
        experience=library.path,
        results=tmp_path / "evaluation",
        methods=("rnd", "knn1"),
        environments=2,
        goals=1,
        overrides="{clutter: {num_blocked: 15}}",
        moves=False,
    )
    assert evaluation.scenario().digest != library.scenario().digest
    rows = run_evaluation(evaluation, say=lambda line: None)
    assert len(rows) == 8
    records = evaluation.reaches.records()
    assert {record.scenario for record in records} == {evaluation.scenario().digest}
    assert {(record.base_y, record.torso) for record in records} == {(0.0, 0.15)}
    for record in records:
        instance = evaluation.scenario().sample_instance("evaluation", record.environment)
        assert instance.p_WA is not None
        assert len(instance.p_WA) == 5
        assert np.min(np.linalg.norm(instance.p_WA - record.start.x0[:3], axis=1)) < 1e-9
