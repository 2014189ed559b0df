"""`lic robot check` on a robot file."""

import json
from pathlib import Path

import pytest
from support.six_joint_arm import write

from lic_drake.cli.main import main


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
