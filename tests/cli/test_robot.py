"""`lic robot check` on a robot file."""

import json
from pathlib import Path

import pytest
from support.six_joint_arm import write

from lic_drake.cli.arguments import overrides_of
from lic_drake.cli.main import main
from lic_drake.config import read_mapping
from lic_drake.evaluate.trials import read_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import find_library


@pytest.mark.usefixtures("_renderer")
def test_a_robot_file_is_checked_and_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path)
    assert main(["robot", "check", str(path), "--json", "--out", str(tmp_path / "out")]) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["reaches"] and values["settles"]
    assert values["forearm_joint"]["stiffness_Nm_per_rad"] == 30.0
    assert Path(values["still"]).stat().st_size > 10_000


def test_a_bad_file_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, "frame: column", "frame: pillar")
    assert main(["robot", "check", str(path)]) == 2
    output, error = capsys.readouterr()
    assert output == "" and len(error.splitlines()) == 1 and "base: frame 'pillar'" in error


@pytest.mark.usefixtures("_coarse")
def test_training_leaves_a_library_a_table_and_a_demonstration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lic_drake.show.pictures.save_rendered", lambda *args: {})
    brief = ["--set", "{stop: {timeout_s: 0.5}}", "--workers", "1"]
    assert main(["train", str(tmp_path), "--reaches", "12", *brief, "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    reaches = ExperienceLibrary(values["library"]).columns()
    assert find_library(tmp_path) == Path(values["library"])
    # Two environments with four goals by COST, or one more that was begun.
    count = values["reaches"]
    assert len(reaches["key"]) == count and count in (8, 12)
    assert set(reaches["stream"]) == {"training"} and not any(map(len, reaches["after"]))
    rounds = read_trials(tmp_path / "learning" / "trials.parquet")
    assert [row.method for row in rounds] == ["cost"] * count
    assert {(rate["method"], rate["trials"]) for rate in values["rates"]} == {
        (method, 1) for method in ("rnd", "cost", "gp")
    }
    assert "| gp | 2 |" in Path(values["table"]).read_text()
    assert Path(values["demo"]).stat().st_size > 10_000


def test_before_spheres_apertures_are_closed_unless_their_number_is_given() -> None:
    def closed(text: str, category: str = "sphere-aperture-clutter") -> object:
        values = read_mapping(overrides_of(text, category), "--set")
        return values.get("clutter", {}).get("num_blocked")

    assert closed("") == closed("{stop: {timeout_s: 9}}") == closed("{clutter: {columns: 5}}") == 8
    assert closed("{clutter: {num_blocked: 0}}") == 0
    assert closed("", "cylinder-clutter") is None
