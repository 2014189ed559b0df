"""The subcommands where environments offer their own goals, and where the base moves."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import FakeReach, collect_here, make_record, make_request

from lic_drake.cli.main import main
from lic_drake.evaluate.trials import read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

PASSAGE, APERTURE = "passage-clutter", "cylinder-aperture-clutter"
SHORT = {
    PASSAGE: "{stop: {timeout_s: 0.2}}",
    APERTURE: "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.2}}",
}


@pytest.fixture
def library(tmp_path: Path, request: pytest.FixtureRequest) -> str:
    """Folder of a library of a category in which hands left of the base succeed, no others."""
    category = getattr(request, "param", APERTURE)
    scenario = load_scenario(category, SHORT[category])
    collection = make_request(scenario=scenario, environments=4, max_starts=None)
    library = ExperienceLibrary(tmp_path / "library")
    for environment in collection.environment_indices:
        records = [
            replace(make_record(item), success=item.start.x0[1] > item.start.b0[1])
            for item in collection.reaches(environment)
        ]
        library.write_shard(f"training-{environment:06d}", records, scenario)
    return str(library.path)


@pytest.mark.parametrize(
    ("category", "environments", "starts"), [(PASSAGE, 12, 14), (APERTURE, 4, 15)]
)
def test_collect_makes_the_papers_reaches_in_each_environment(
    category: str,
    environments: int,
    starts: int,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reach, total = FakeReach(log=tmp_path / "calls"), environments * starts
    collect_here(monkeypatch, reach)
    path = tmp_path / "new"
    command = ["collect", str(path), "--scenario", category, "--environments", str(environments)]
    assert main(command) == 0
    output, error = capsys.readouterr()
    counts = f"{environments} environments x 1 goals x {starts} starts, {total} reaches into"
    assert f"{category}: {counts}" in error
    assert f"{total} of {total} reaches ({total} new in " in output
    columns = ExperienceLibrary(path).columns()
    assert len(set(zip(columns["environment"], columns["goal_y"], strict=True))) == environments
    assert len(set(columns["base_y"])) == (total if category == APERTURE else 1)
    assert main(["experience", "check", str(path)]) == 0


@pytest.mark.usefixtures("_here")
def test_a_real_reach_through_an_aperture_is_collected_and_comes_out_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "new")
    command = ["collect", path, "--scenario", APERTURE, "--set", SHORT[APERTURE]]
    assert main([*command, "--environments", "1", "--max-starts", "2", "--workers", "1"]) == 0
    assert "2 of 2 reaches" in capsys.readouterr().out
    assert main(["experience", "recompute", path, "--rows", "2"]) == 0
    assert capsys.readouterr().out.startswith("2 of 2 rows are identical to the last bit")


def test_reach_goes_to_the_goal_that_the_environment_offers_unless_told_otherwise(
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = ["reach", "--scenario", PASSAGE, "--set", SHORT[PASSAGE], "--json"]
    goals = []
    for options in (["--environment", "1"], ["--goal", "0.5", "0.1"]):
        assert main([*command, *options]) == 0
        record = json.loads(capsys.readouterr().out)
        goals.append((record["goal_x"], record["goal_y"], record["goal_z"]))
    offered = load_scenario(PASSAGE).sample_goal("evaluation", 1)
    assert goals == [tuple(offered), (0.5, 0.1, 0.0)]


@pytest.mark.parametrize("method", ["knn1", "rnd>cost"])
def test_select_names_aperture_and_base(
    library: str, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    command = ["select", "--goal", "0.7", "0.1", "--library", library, "--seed", "2"]
    assert main([*command, "--method", method, "--json"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    scenario = load_scenario(APERTURE, SHORT[APERTURE])
    p_WA = scenario.sample_instance("evaluation", 2).p_WA
    assert p_WA is not None
    assert np.linalg.norm(p_WA[:, :2] - chosen["start"][:2], axis=1).min() < 1e-9
    pose = scenario.arm().tip_pose(np.array(chosen["joint_angles"])) + [*chosen["base"], 0.0]
    np.testing.assert_allclose(pose, chosen["start"], atol=1e-9)
    if method == "knn1":
        assert chosen["start"][1] > chosen["base"][1]
        assert chosen["estimated_success"] > 0.5


def test_select_takes_goals_that_a_base_aside_can_reach(
    library: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["select", "--method", "cost", "--library", library, "--seed", "2", "--goal"]
    # 0.89 m from the origin, which is more than the arm is long.
    assert main([*command, "0.8", "0.4"]) == 0
    assert main([*command, "0.9", "0.4"]) == 2
    assert "and the arm reaches 0.833 m; choose a nearer goal" in capsys.readouterr().err


@pytest.mark.usefixtures("_coarse")
@pytest.mark.parametrize("library", [PASSAGE], indirect=True)
def test_demo_shows_the_librarys_category(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})
    out = tmp_path / "out"
    command = ["demo", "--method", "knn1", "--seed", "4", "--library", library, "--out", str(out)]
    assert main(command) == 0
    data = json.loads((out / "demo.json").read_text(encoding="utf-8"))
    category = data["attempts"][0]["record"]["category"]
    assert category == ExperienceLibrary(library).scenario().category
    assert data["goal"] == load_scenario(category).sample_goal("evaluation", 4).tolist()
    for name in ("demo.html", "density.png", "path.png"):
        assert (out / name).stat().st_size > 1000


@pytest.mark.usefixtures("_here")
def test_evaluate_prints_rates_and_resumes(
    library: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = tmp_path / "results"
    command = ["evaluate", str(results), "--library", library]
    command += ["--methods", "rnd", "knn1>cost", "--environments"]

    def table() -> list[list[str]]:
        lines = capsys.readouterr().out.splitlines()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
        return [row for row in rows if row and row[0] in ("rnd", "knn1>cost")]

    def wall_times() -> dict[str, float]:
        records = ExperienceLibrary(results / "reaches").records()
        return {record.key: record.wall_time_s for record in records}

    assert main([*command, "1"]) == 0
    first = table()
    assert [row[:2] for row in first] == [
        *(["knn1>cost", "1"], ["rnd", "1"], ["knn1>cost", "2"], ["rnd", "2"])
    ]
    assert {row[4] for row in first} == {"1"}
    times = wall_times()
    assert main([*command, "2", "--variant", "again"]) == 0
    assert {row[4] for row in table()} == {"2"}
    # They would differ if a reach had been simulated again.
    assert times.items() < wall_times().items()
    rows = read_trials(results / "trials.parquet")
    assert {row.variant for row in rows} == {"", "again"}
    # Nothing can be reached in 0.2 s: a second attempt follows every first one.
    assert sorted(row.attempt for row in rows) == [1] * 6 + [2] * 6


def test_bench_times_several_starts_into_one_passage(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["bench", "reach", "--scenario", PASSAGE, "--set", SHORT[PASSAGE]]
    assert main([*command, "--reaches", "3", "--json"]) == 0
    speed = json.loads(capsys.readouterr().out)
    assert (speed["category"], speed["reaches"]) == (PASSAGE, 3)
    assert speed["split"]["build"] > 0.0
