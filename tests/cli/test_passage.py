"""The subcommands with passage-clutter, whose environments offer their own goals."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from support.fake_reach import FakeReach, collect_here, make_record, make_request

from lic_drake.cli.main import main
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

SHORT = "{stop: {timeout_s: 0.2}}"


@pytest.fixture
def library(tmp_path: Path) -> str:
    """Folder of a library of six environments; starts left of the middle succeed, no others."""
    scenario = load_scenario("passage-clutter", SHORT)
    request = make_request(scenario=scenario, environments=6, max_starts=None)
    library = ExperienceLibrary(tmp_path / "library")
    for environment in request.environment_indices:
        records = [
            replace(make_record(item), success=item.start.x0[1] > 0.0)
            for item in request.reaches(environment)
        ]
        library.write_shard(f"training-{environment:06d}", records, scenario)
    return str(library.path)


def test_collect_makes_the_papers_1680_reaches(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reach = FakeReach(log=tmp_path / "calls")
    collect_here(monkeypatch, reach)
    path = tmp_path / "new"
    command = ["collect", str(path), "--scenario", "passage-clutter", "--environments", "120"]
    assert main(command) == 0
    output = capsys.readouterr().out
    assert "passage-clutter: 120 environments x 1 goals x 14 starts = 1680 reaches" in output
    assert "1680 of 1680 reaches (1680 new in " in output
    columns = ExperienceLibrary(path).columns()
    assert len(set(zip(columns["environment"], columns["goal_y"], strict=True))) == 120


def test_reach_goes_to_the_goal_that_the_environment_offers_unless_told_otherwise(
    capsys: pytest.CaptureFixture[str],
) -> None:
    command = ["reach", "--scenario", "passage-clutter", "--set", SHORT, "--json"]
    goals = []
    for options in (["--environment", "0"], ["--environment", "1"], ["--goal", "0.5", "0.1"]):
        assert main([*command, *options]) == 0
        record = json.loads(capsys.readouterr().out)
        goals.append((record["goal_x"], record["goal_y"], record["goal_z"]))
    scenario = load_scenario("passage-clutter")
    offered = [scenario.sample_goal("evaluation", environment) for environment in (0, 1)]
    assert goals == [*map(tuple, offered), (0.5, 0.1, 0.0)]


@pytest.mark.parametrize("method", ["gp", "knn"])
def test_select_learns_from_passages(
    library: str, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    command = ["select", "--goal", "0.695", "0.05", "--method", method, "--library", library]
    assert main([*command, "--json"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    assert chosen["start"][1] > 0.0
    assert chosen["estimated_success"] > 0.5


def test_evaluate_tries_each_passage_once(
    library: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["evaluate", str(tmp_path / "results"), "--library", library, "--workers", "1"]
    command += ["--environments", "2", "--methods", "rnd", "cost", "gp"]
    assert main(command) == 0
    lines = capsys.readouterr().out.splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines][-6:]
    # After one and after two attempts at the two passages.
    assert [row[:2] for row in rows] == [[m, n] for n in "12" for m in ("cost", "gp", "rnd")]
    assert {row[4] for row in rows} == {"2"}
    # The same passage twice would count the same reach twice.
    assert main([*command, "--goals", "2"]) == 2
    assert "offers 1 goal, 2 were asked for; take one goal in each" in capsys.readouterr().err


def test_demo_reaches_into_a_passage(library: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["demo", "--seed", "4", "--library", library, "--out", str(out)]) == 0
    data = json.loads((out / "demo.json").read_text(encoding="utf-8"))
    goal = load_scenario("passage-clutter").sample_goal("evaluation", 4)
    assert data["goal"] == goal.tolist()
    assert data["attempts"][0]["record"]["category"] == "passage-clutter"


def test_bench_times_several_starts_into_one_passage(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["bench", "reach", "--scenario", "passage-clutter", "--set", SHORT]
    assert main([*command, "--reaches", "3", "--json"]) == 0
    speed = json.loads(capsys.readouterr().out)
    assert (speed["category"], speed["reaches"]) == ("passage-clutter", 3)
    assert speed["split"]["build"] > 0.0
