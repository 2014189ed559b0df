import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.fake_reach import comparable, make_record
from support.made_up import BRIEF, NARROW, planar_library, small_cameras, sphere_library

from lic_drake.errors import LibraryError, RequestError
from lic_drake.evaluate import trial as dut
from lic_drake.evaluate.trial import Evaluation, run_evaluation
from lic_drake.evaluate.trials import TrialRow, read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import LocalWorkers
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import load_scenario

Evaluate = Callable[..., Evaluation]
LEARNED = ("rnd", "knn1")
EASY = "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.2}}"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Keys of the simulated (here: fake) reaches."""
    keys: list[str] = []

    def reach(request: ReachRequest) -> ReachRecord:
        keys.append(request.key)
        return make_record(request)

    monkeypatch.setattr(dut, "run_reach", reach)
    return keys


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("cylinders") / "library"
    return planar_library(path, load_scenario("cylinder-clutter", EASY)).path


@pytest.fixture
def evaluation(library: Path, tmp_path: Path) -> Evaluate:
    """Makes an evaluation of baselines, which select at once, unless told otherwise."""

    def make(**values: Any) -> Evaluation:
        paths = {"experience": library, "results": tmp_path / "out"}
        defaults = {"methods": ("rnd", "cost"), "environments": 3, "goals": 2}
        return Evaluation(**{**paths, **defaults, **values})

    return make


def without_times(rows: list[TrialRow]) -> list[str]:
    return [repr(replace(row, seconds=0.0)) for row in rows]


def quiet(_: str) -> None:
    pass


def test_strategies_are_tried_at_the_same_goals_of_the_same_environments(
    evaluation: Evaluate, calls: list[str]
) -> None:
    asked = evaluation(methods=LEARNED)
    lines: list[str] = []
    rows = run_evaluation(asked, say=lines.append)
    records = {record.key: record for record in asked.reaches.records()}
    scenario = asked.reaches.scenario()
    firsts = [row for row in rows if row.attempt == 1]
    tried = [(row.environment, row.goal) for row in firsts]  # First knn1's, then RND's.
    assert tried == 2 * [(e, g) for e in range(3) for g in (0, 1)]
    for row in rows:
        record = records[row.key]
        assert (record.stream, record.environment) == ("evaluation", row.environment)
        expected = scenario.sample_goal("evaluation", row.environment, row.goal)
        np.testing.assert_array_equal(record.p_WG, expected)
    # Learned from the library: starts left of the middle succeed.
    assert all(records[row.key].start_y > 0.0 for row in firsts if row.method == "knn1")
    assert any(records[row.key].start_y < 0.0 for row in firsts if row.method == "rnd")
    won = sum(row.success for row in rows)
    assert lines[-1].startswith(
        f"  3/3 environments, {len(rows)} attempts, {won} reached, 0 s left"
    )


def test_rows_agree_with_the_library_of_reaches(evaluation: Evaluate, calls: list[str]) -> None:
    asked = evaluation(methods=LEARNED, attempts=3)
    rows = run_evaluation(asked, say=quiet)
    records = {record.key: record for record in asked.reaches.records()}
    scenario = asked.reaches.scenario()
    assert sorted(records) == sorted({row.key for row in rows}) == sorted(calls)
    trials: dict[tuple[str, int, int], list[TrialRow]] = {}
    for row in rows:
        assert row.success == records[row.key].success
        assert np.isnan(row.probability) == (row.method == "rnd")
        trials.setdefault((row.method, row.environment, row.goal), []).append(row)
    assert any(len(trial) == 3 for trial in trials.values())
    for trial in trials.values():
        assert [row.attempt for row in trial] == list(range(1, len(trial) + 1))
        assert trial[-1].success or len(trial) == 3
        # Each attempt finds the environment as the previous ones left it.
        chain = [ReachRequest.from_record(records[row.key], scenario) for row in trial]
        for number, request in enumerate(chain):
            assert len(request.after) == number
            assert request.before() == (chain[number - 1] if number else None)


def test_a_second_run_simulates_nothing_and_a_larger_one_only_what_is_new(
    evaluation: Evaluate, calls: list[str]
) -> None:
    asked = evaluation(environments=2, goals=1, attempts=1)
    rows = without_times(run_evaluation(asked, say=quiet))
    content = comparable(asked.reaches.records())
    first = set(calls)
    calls.clear()
    assert without_times(run_evaluation(asked, say=quiet)) == rows
    assert without_times(read_trials(asked.trials_path)) == rows
    assert calls == []
    assert comparable(asked.reaches.records()) == content
    larger = run_evaluation(replace(asked, environments=3, goals=2, attempts=2), say=quiet)
    assert calls and not set(calls) & first
    # This includes RND's draws, which are independent of the number of trials.
    assert set(rows) <= set(without_times(larger))


def test_an_interrupted_evaluation_simulates_nothing_twice(
    evaluation: Evaluate,
    tmp_path: Path,
    calls: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dut, "SAY_S", 0.0)
    asked = evaluation(environments=5)
    expected = without_times(run_evaluation(replace(asked, results=tmp_path / "whole"), say=quiet))
    calls.clear()
    lines: list[str] = []

    def interrupt(line: str) -> None:
        lines.append(line)
        if len(lines) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_evaluation(asked, say=interrupt)
    kept = set(asked.reaches.successes())
    assert kept and kept == set(calls)
    assert not asked.trials_path.exists()
    calls.clear()
    assert without_times(run_evaluation(asked, say=quiet)) == expected
    assert not kept & set(calls)
    assert kept | set(calls) == asked.reaches.successes().keys()


def test_the_file_keeps_trials_of_other_variants_and_strategies(
    evaluation: Evaluate, tmp_path: Path, calls: list[str]
) -> None:
    plain = evaluation()
    rows = run_evaluation(plain, say=quiet)
    other = run_evaluation(replace(plain, attempts=1, variant="other"), say=quiet)
    more = run_evaluation(replace(plain, methods=("rnd>cost",)), say=quiet)
    # Fewer environments: replaces the trials of the same variant and method.
    fewer = run_evaluation(replace(plain, methods=("rnd",), environments=1), say=quiet)
    expected = [*(row for row in rows if row.method == "cost"), *other, *more, *fewer]
    stored = read_trials(tmp_path / "out" / "trials.parquet")
    assert sorted(without_times(stored)) == sorted(without_times(expected))


def test_apertures_are_evaluated_with_bases_and_strategies_may_follow_others(
    evaluation: Evaluate, tmp_path: Path, calls: list[str]
) -> None:
    apertures = load_scenario("cylinder-aperture-clutter", EASY)
    library = planar_library(tmp_path / "library", apertures).path
    methods = ("rnd", "cost", "rnd>cost")
    asked = evaluation(experience=library, methods=methods, goals=1)
    rows = run_evaluation(asked, say=quiet)
    scenario = asked.reaches.scenario()
    assert len({record.base_y for record in asked.reaches.records()}) > 3
    for record in asked.reaches.records():
        p_WA = scenario.sample_instance("evaluation", record.environment).p_WA
        assert p_WA is not None
        assert np.linalg.norm(p_WA[:, :2] - record.start.x0[:2], axis=1).min() < 1e-9
    assert {row.method for row in rows} == set(asked.methods)
    firsts = {m: [r.key for r in rows if (r.method, r.attempt) == (m, 1)] for m in asked.methods}
    assert firsts["rnd>cost"] == firsts["rnd"] != firsts["cost"]


def test_a_worker_process_gives_the_rows_and_reaches_of_this_process(
    evaluation: Evaluate, tmp_path: Path
) -> None:
    results = []
    with LocalWorkers(1) as process:
        for i, workers in enumerate((None, process)):
            asked = evaluation(results=tmp_path / str(i), methods=LEARNED, environments=2, goals=1)
            rows = run_evaluation(asked, workers, quiet)
            results.append((without_times(rows), comparable(asked.reaches.records())))
    assert results[0] == results[1]
    assert len(results[0][0]) > 4
    # These were simulated: the longest ends by the time limit.
    assert max(record.duration_s for record in asked.reaches.records()) == pytest.approx(0.2)


def test_what_cannot_be_evaluated_is_refused_before_any_reach(
    evaluation: Evaluate, library: Path, tmp_path: Path, calls: list[str]
) -> None:
    with pytest.raises(RequestError, match="unknown method 'svm'"):
        run_evaluation(evaluation(methods=("rnd", "svm")))
    assert not (tmp_path / "out").exists()
    copied = shutil.copytree(library, tmp_path / "library")
    asked = evaluation(experience=copied, methods=("rnd",))
    run_evaluation(asked, say=quiet)
    calls.clear()
    with pytest.raises(RequestError, match="goals must be at least 1, got 0"):
        run_evaluation(replace(asked, goals=0), say=quiet)
    with pytest.raises(LibraryError, match="holds reaches of scenario"):
        run_evaluation(replace(asked, overrides="{stop: {timeout_s: 0.4}}"), say=quiet)
    # What a worker cannot read is an error here.
    (shard, *_) = ExperienceLibrary(copied).shard_paths()
    shard.write_bytes(shard.read_bytes()[:-100])
    with pytest.raises(LibraryError, match="is damaged or not a Parquet file"):
        run_evaluation(asked, say=quiet)
    assert calls == []


# The PR2, whose experience is made up


@pytest.fixture(scope="module")
def spheres(tmp_path_factory: pytest.TempPathFactory) -> ExperienceLibrary:
    return sphere_library(tmp_path_factory.mktemp("spheres"))


def test_an_evaluation_may_block_apertures_and_keep_the_robot_where_it_is(
    spheres: ExperienceLibrary, tmp_path: Path
) -> None:
    asked = Evaluation(
        experience=spheres.path,
        results=tmp_path / "evaluation",
        methods=("rnd", "cost"),
        environments=2,
        goals=1,
        overrides="{clutter: {num_blocked: 15}}",
        moves=False,
    )
    assert len(run_evaluation(asked, say=quiet)) == 8
    records = asked.reaches.records()
    assert {record.scenario for record in records} == {asked.scenario().digest}
    assert {(record.base_y, record.torso) for record in records} == {(0.0, 0.15)}
    for record in records:
        instance = asked.scenario().sample_instance("evaluation", record.environment)
        assert instance.p_WA is not None and len(instance.p_WA) == 5
        assert np.min(np.linalg.norm(instance.p_WA - record.start.x0[:3], axis=1)) < 1e-9


@pytest.mark.usefixtures("_renderer")
def test_strategies_are_compared_by_what_the_cameras_see(
    spheres: ExperienceLibrary, tmp_path: Path
) -> None:
    asked = Evaluation(
        experience=spheres.path,
        results=tmp_path,
        methods=("cost",),
        environments=1,
        goals=1,
        attempts=1,
        scenario_name="foliage-aperture-clutter",
        overrides=f"{{{BRIEF}, {NARROW}, clutter: {{num_stems: 3, num_branches: 1}}}}",
        cameras=str(small_cameras(tmp_path / "small.yaml")),
    )
    run_evaluation(asked, say=quiet)
    (record,) = asked.reaches.records()
    true = asked.scenario().sample_goal("evaluation", 0)
    assert 1e-4 < np.linalg.norm(record.p_WG - true) < 0.05
