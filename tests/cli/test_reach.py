import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from lic_drake.cli.main import main
from lic_drake.reach.request import OUTCOMES, ReachRecord
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.session import run_reach

SMALL = "{clutter: {num_movable: 2, num_fixed: 2}, stop: {timeout_s: 0.4}}"
LIC_REACH = ["reach", "--set", SMALL]


def refuse_constants(name: str) -> Any:
    raise AssertionError(f"{name} is not JSON")


def run_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main([*LIC_REACH, "--json", *arguments]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    record: dict[str, Any] = json.loads(output.out, parse_constant=refuse_constants)
    return record


def test_json_output_is_the_record(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--goal", "0.5", "-0.1", "--start-y", "-0.1", "--start-phi", "30"]
    values = run_json(capsys, *arguments, "--environment", "3", "--stream", "training")
    assert list(values) == [item.name for item in dataclasses.fields(ReachRecord)]
    assert values["outcome"] in OUTCOMES
    assert (values["stream"], values["environment"]) == ("training", 3)
    assert (values["goal_x"], values["goal_y"], values["goal_z"]) == (0.5, -0.1, 0.0)
    assert (values["start_x"], values["start_y"]) == (0.335, -0.1)
    assert values["start_phi"] == pytest.approx(0.5235987755982988)
    assert values["scenario"] == load_scenario("cylinder-clutter", SMALL).digest
    values["q_start"], values["q_final"] = tuple(values["q_start"]), tuple(values["q_final"])
    record = ReachRecord(**values)
    assert record.duration_s == 0.4 and len(record.q_final) == 3


def test_the_text_says_how_it_ended(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(LIC_REACH) == 0
    output = capsys.readouterr().out
    assert output.startswith("timeout after 0.40 s (")
    assert output.count("\n") == 1
    reached = "{clutter: {num_movable: 0, num_fixed: 0}}"
    assert main(["reach", "--set", reached, "--goal", "0.4", "0.05"]) == 0
    assert capsys.readouterr().out.startswith("reached after ")


def test_a_recording_is_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    html = tmp_path / "reach.html"
    plain = run_json(capsys)
    shown = run_json(capsys, "--record", str(html))
    del plain["wall_time_s"], shown["wall_time_s"]
    assert shown == plain
    content = html.read_text(encoding="utf-8")
    assert content.lstrip().lower().startswith("<!doctype html")
    assert len(content) > 1_000_000


def test_a_recording_leaves_the_output_to_the_command(tmp_path: Path) -> None:
    # In a process of its own, where Drake's log goes to the terminal.
    command = [sys.executable, "-m", "lic_drake", *LIC_REACH, "--json"]
    result = subprocess.run(
        [*command, "--record", str(tmp_path / "reach.html")], capture_output=True, text=True
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert json.loads(result.stdout)["outcome"] == "timeout"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--goal", "5", "0"], "the goal (5, 0) m is 5.000 m from the base and the arm reaches"),
        (["--goal", "0.6", "inf"], "a goal is three finite numbers in metres, got [0.6, inf, 0.0]"),
        (["--goal", "0.6"], "a goal of cylinder-clutter is 2 numbers in metres, got 1: --goal 0.6"),
        (["--start-y", "nan"], "x0 of a start must be finite numbers"),
        (["--start-y", "9"], "cannot start at y +9.000 m, phi +60.0 degrees: no configuration"),
        (["--scenario", "none.yaml"], "no scenario 'none.yaml'; shipped scenarios: "),
        (["--set", "{stop: {timeout_s: -1}}"], "cylinder-clutter: stop: timeout_s must be from 0"),
        (["--set", "{"], "overrides: not YAML: "),
        (["--set", "{mpc: {preset: best}}"], "unknown mpc preset 'best'"),
        (["--stream", "test"], "unknown seed stream 'test'; choose one of training, evaluation"),
        (["--environment", "4294967296"], "seed indices must be from 0 to 2^32 - 1, got"),
        (["--record", "{tmp}"], "cannot write {tmp}: "),
        (["--record", "{tmp}/a.html", "--start-y", "9"], "cannot start at y +9.000 m"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: list[str], message: str
) -> None:
    arguments = [argument.replace("{tmp}", str(tmp_path)) for argument in arguments]
    assert main([*LIC_REACH, *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("lic: error: ")
    assert output.err.count("\n") == 1
    assert message.replace("{tmp}", str(tmp_path)) in output.err
    assert list(tmp_path.iterdir()) == []


def test_a_reach_that_fails_in_the_simulator_is_reported_not_raised(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(request: Any) -> ReachRecord:
        return dataclasses.replace(run_reach(request), outcome="diverged", detail="solver failed")

    monkeypatch.setattr("lic_drake.reach.session.run_reach", diverge)
    assert main(LIC_REACH) == 0
    assert capsys.readouterr().out.startswith("diverged after 0.40 s")


PR2 = ["reach", "--scenario", "sphere-aperture-clutter", "--set", "{stop: {timeout_s: 0.4}}"]


def test_a_pr2_reaches_through_the_aperture_that_is_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    place = ["--aperture", "-0.3", "1.0", "--base-y", "0.1", "--torso", "0.2"]
    assert main([*PR2, "--json", "--goal", "0.84", "-0.2", "0.95", *place]) == 0
    values = json.loads(capsys.readouterr().out)
    assert (values["goal_z"], values["base_y"], values["torso"]) == (0.95, 0.1, 0.2)
    assert values["start_y"] == pytest.approx(-0.29) and values["start_z"] == pytest.approx(0.99)
    assert values["duration_s"] == 0.4 and len(values["q_final"]) == 7


def test_a_pr2_has_defaults_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*PR2, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    goal = load_scenario("sphere-aperture-clutter").sample_goal("evaluation", 0)
    assert [values[f"goal_{axis}"] for axis in "xyz"] == goal.tolist()
    assert abs(values["start_y"] - goal[1]) <= 0.1 and abs(values["start_z"] - goal[2]) <= 0.1
    assert (values["base_y"], values["torso"]) == (0.0, 0.15)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--base-y", "0.5"], "--base-y must be from -0.3 to 0.3 m, got 0.5"),
        (["--torso", "nan"], "--torso must be from 0.0115 to 0.305 m, got nan"),
        (["--goal", "0.8", "0.0"], "is 3 numbers in metres, got 2: --goal 0.8 0.0"),
        (["--aperture", "3", "0"], "there is no open aperture at y 3.0 m"),
        (["--start-phi", "3"], "--start-phi is not for the robot of sphere-aperture-clutter, pr2"),
        (["--goal", "3", "0", "1"], "choose a nearer goal"),
    ],
)
def test_what_a_pr2_cannot_do_is_one_line(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*PR2, *arguments]) != 0
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
