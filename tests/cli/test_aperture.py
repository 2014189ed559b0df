"""The subcommands with cylinder-aperture-clutter, where the base moves."""

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

NAME = "cylinder-aperture-clutter"
SHORT = "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.2}}"


@pytest.fixture
def library(tmp_path: Path) -> str:
    """Folder of a library in which hands left of the base succeed, and no others."""
    scenario = load_scenario(NAME, SHORT)
    request = make_request(scenario=scenario, environments=4, max_starts=None)
    library = ExperienceLibrary(tmp_path / "library")
    for environment in request.environment_indices:
        records = [
            replace(make_record(item), success=item.start.x0[1] > item.start.b0[1])
            for item in request.reaches(environment)
        ]
        library.write_shard(f"training-{environment:06d}", records, scenario)
    return str(library.path)


def test_collect_makes_15_reaches_in_each_environment(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    reach = FakeReach(log=tmp_path / "calls")
    collect_here(monkeypatch, reach)
    path = tmp_path / "new"
    assert main(["collect", str(path), "--scenario", NAME, "--environments", "4"]) == 0
    output = capsys.readouterr().out
    assert f"{NAME}: 4 environments x 1 goals x 15 starts = 60 reaches" in output
    assert "60 of 60 reaches (60 new in " in output
    columns = ExperienceLibrary(path).columns()
    assert len(set(columns["base_y"])) == 60
    assert len(set(zip(columns["environment"], columns["start_y"], strict=True))) == 4 * 3
    assert len(set(zip(columns["goal_x"], columns["goal_y"], strict=True))) == 4
    # Run again, it goes on: there is nothing left to do.
    assert main(["collect", str(path)]) == 0
    assert len(reach.calls()) == 60
    assert main(["experience", "check", str(path)]) == 0


def test_a_real_reach_through_an_aperture_is_collected_and_comes_out_the_same_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = str(tmp_path / "new")
    command = ["collect", path, "--scenario", NAME, "--set", SHORT, "--environments", "1"]
    assert main([*command, "--max-starts", "2", "--workers", "1"]) == 0
    assert "2 of 2 reaches" in capsys.readouterr().out
    assert main(["experience", "recompute", path, "--rows", "2"]) == 0
    assert capsys.readouterr().out.startswith("2 of 2 rows are the same to the last bit")


@pytest.mark.parametrize("method", ["rnd", "cost", "gp1", "rnd>cost"])
def test_select_names_aperture_and_base(
    library: str, capsys: pytest.CaptureFixture[str], method: str
) -> None:
    command = ["select", "--goal", "0.7", "0.1", "--library", library, "--seed", "2"]
    assert main([*command, "--method", method, "--json"]) == 0
    chosen = json.loads(capsys.readouterr().out)
    scenario = load_scenario(NAME, SHORT)
    p_WA = scenario.sample_instance("evaluation", 2).p_WA
    assert p_WA is not None
    assert np.linalg.norm(p_WA[:, :2] - chosen["start"][:2], axis=1).min() < 1e-9
    pose = scenario.arm().tip_pose(np.array(chosen["joint_angles"])) + [*chosen["base"], 0.0]
    np.testing.assert_allclose(pose, chosen["start"], atol=1e-9)
    if method.startswith("gp"):
        assert chosen["start"][1] > chosen["base"][1]
        assert chosen["estimated_success"] > 0.5
    assert main([*command, "--method", method]) == 0
    text = capsys.readouterr().out
    assert f", base at y {chosen['base'][1]:+.3f} m" in text


def test_select_takes_goals_that_a_base_aside_can_reach(
    library: str, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["select", "--method", "cost", "--library", library, "--seed", "2", "--goal"]
    # 0.89 m from the origin, which is more than the arm is long.
    assert main([*command, "0.8", "0.4"]) == 0
    assert main([*command, "0.9", "0.4"]) == 2
    assert "and the arm reaches 0.833 m; choose a nearer goal" in capsys.readouterr().err


def test_demo_reaches_through_an_aperture(
    library: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    command = ["demo", "--method", "gp1", "--seed", "4", "--library", library, "--out", str(out)]
    assert main(command) == 0
    data = json.loads((out / "demo.json").read_text(encoding="utf-8"))
    assert data["attempts"][0]["record"]["category"] == NAME
    assert "base at y" in capsys.readouterr().out
    for name in ("demo.html", "density.png", "path.png"):
        assert (out / name).stat().st_size > 1000


def test_evaluate_prints_rates_and_goes_on_where_it_was(
    library: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = tmp_path / "results"
    command = ["evaluate", str(results), "--library", library, "--workers", "1"]
    command += ["--methods", "rnd", "gp1>cost", "--environments"]

    def table() -> list[list[str]]:
        lines = capsys.readouterr().out.splitlines()
        rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
        return [row for row in rows if row and row[0] in ("rnd", "gp1>cost")]

    assert main([*command, "1"]) == 0
    first = table()
    assert [row[:2] for row in first] == [
        *(["gp1>cost", "1"], ["rnd", "1"], ["gp1>cost", "2"], ["rnd", "2"])
    ]
    assert {row[4] for row in first} == {"1"}
    times = _wall_times(results)
    assert main([*command, "2", "--variant", "again"]) == 0
    assert {row[4] for row in table()} == {"2"}
    assert times.items() < _wall_times(results).items()
    rows = read_trials(results / "trials.parquet")
    assert {row.variant for row in rows} == {"", "again"}
    # Nothing can be reached in 0.2 s: a second attempt follows every first one.
    assert sorted(row.attempt for row in rows) == [1] * 6 + [2] * 6


def _wall_times(results: Path) -> dict[str, float]:
    """Wall time of each reach; they would differ if it had been simulated again."""
    records = ExperienceLibrary(results / "reaches").records()
    return {record.key: record.wall_time_s for record in records}
