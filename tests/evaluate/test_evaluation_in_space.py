"""Evaluations of the PR2 whose experience is made up."""

from pathlib import Path

import numpy as np
import pytest
from support.made_up import small_cameras, sphere_library

from lic_drake.evaluate.trial import Evaluation, run_evaluation
from lic_drake.experience.store import ExperienceLibrary


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    return sphere_library(tmp_path_factory.mktemp("spheres"))


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


@pytest.mark.usefixtures("_renderer")
def test_strategies_are_compared_by_what_the_cameras_see(
    library: ExperienceLibrary, tmp_path: Path
) -> None:
    evaluation = Evaluation(
        experience=library.path,
        results=tmp_path,
        methods=("cost",),
        environments=1,
        goals=1,
        attempts=1,
        scenario_name="foliage-aperture-clutter",
        overrides="{stop: {timeout_s: 0.2}, clutter: {num_stems: 3, num_branches: 1}}",
        cameras=str(small_cameras(tmp_path / "small.yaml")),
    )
    rows = run_evaluation(evaluation)
    assert [row.method for row in rows] == ["cost"]
    (record,) = evaluation.reaches.records()
    true = evaluation.scenario().sample_goal("evaluation", 0)
    assert 1e-4 < np.linalg.norm(record.p_WG - true) < 0.05
