"""`lic demo --visuals drake_models`, with a copy of Drake's models and without."""

from pathlib import Path
from typing import Any

import pytest
from support.mesh_package import go_offline, write_drake_models

from lic_drake.cli.main import main
from lic_drake.show import demonstration
from lic_drake.show.demonstration import Demonstration


@pytest.fixture
def worn(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """What demonstrations were asked to wear."""
    worn: list[Any] = []

    def demonstrate(*args: Any, meshes: list[Any], cameras: Any) -> Demonstration:
        worn.append([mesh.path.stem for mesh in meshes])
        return Demonstration(p_WG=args[0], attempts=[], success=False, files={})

    monkeypatch.setattr(demonstration, "demonstrate", demonstrate)
    go_offline(monkeypatch, tmp_path)
    return worn


def test_a_pr2_wears_drakes_meshes_if_asked_to(
    worn: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_drake_models(tmp_path)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    assert main(["demo", "--robot", "pr2", "--visuals", "drake_models"]) == 0
    assert main(["demo", "--robot", "pr2"]) == 0
    assert worn == [["base", "torso", "head", "head", "arm", "palm"], []]


def test_offline_it_says_so_in_a_line_and_goes_on(
    worn: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", "--robot", "pr2", "--visuals", "drake_models"]) == 0
    assert worn == [[]]
    download, reason = capsys.readouterr().out.splitlines()
    assert download.startswith("downloading package://drake_models, for 60 s at most")
    assert reason.startswith("the PR2 keeps the shapes of its own model: package://drake_models is")
