import json
from pathlib import Path

import pytest

from lic_drake.cli.main import main
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library

HEADER = "success,goal_x,goal_y,start_y,start_phi\n"


@pytest.fixture
def passages(tmp_path: Path) -> Path:
    """A sixth of the shipped library."""
    shipped, few = ExperienceLibrary(shipped_library("passage-clutter")), tmp_path / "passages"
    ExperienceLibrary(few).write_shard("few", shipped.records()[:280], shipped.scenario())
    return few


@pytest.fixture
def contradiction(tmp_path: Path) -> Path:
    """Records of a robot that succeeds only from starts that the simulation advises against."""
    lines = [
        f"{int(y > 4)},0.695,0.0,{y / 40:.3f},{phi / 20}\n"
        for y in range(-16, 13, 2)
        for phi in range(0, 27, 2)
    ]
    path = tmp_path / "lab.csv"
    path.write_text(HEADER + "".join(lines))
    return path


def select(library: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    command = "select --goal 0.695 0.0 --method knn1 --json --library"
    assert main([*command.split(), str(library)]) == 0
    return json.loads(capsys.readouterr().out)


def test_what_was_added_changes_what_is_selected(
    passages: Path, contradiction: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = select(passages, capsys)
    command = ["experience", "add", str(passages), str(contradiction), "--source", "lab"]
    assert main([*command, "--weight", "100", "--json"]) == 0
    addition = json.loads(capsys.readouterr().out)
    assert (addition["source"], addition["weight"], addition["origin"]) == ("lab", 100.0, "lab.csv")
    after = select(passages, capsys)
    assert before["start"][1] < 0.0 < 0.1 < after["start"][1]


def test_info_and_check_tell_of_additions(
    passages: Path, contradiction: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["experience", "add", str(passages), str(contradiction), "--source", "lab"]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert told.startswith("added 210 records of lab, ")
    assert main(["experience", "info", str(passages)]) == 0
    text = capsys.readouterr().out
    assert told.removeprefix("added ") in text
    assert "of 280 = " in text
    assert main(["experience", "info", str(passages), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["added"][0]["records"] == 210
    assert main(["experience", "check", str(passages)]) == 0
    text = capsys.readouterr().out
    assert "added       210 records from elsewhere\n" in text
    assert text.endswith("sound\n")


def test_a_wrong_row_is_one_line_on_stderr_and_nothing_is_written(
    passages: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(HEADER + "1,0.6,0,0,1\n0,0.6,0,0,60\n")
    assert main(["experience", "add", str(passages), str(path), "--source", "lab"]) == 2
    error = capsys.readouterr().err
    assert error == (
        "lic: error: wrong.csv, row 2: start_phi is 60 rad, which must be from -3.1416 to 3.1416;"
        " directions are in radians, not degrees\n"
    )
    assert not (passages / "_added").exists()


def test_a_weight_that_is_no_number_is_refused(
    passages: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["experience", "add", str(passages), "x.csv", "--source", "lab", "--weight", "much"])
    assert end.value.code == 2
    assert "needs a number, got 'much'" in capsys.readouterr().err
