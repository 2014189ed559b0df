"""Drake's models on this machine, in its cache, nowhere; no test uses a network."""

import hashlib
import json
import os
import sys
import time
from pathlib import Path

import pytest
from pydrake.common import FindResourceOrThrow
from support.mesh_package import go_offline, write_drake_models

from lic_drake.errors import ModelError
from lic_drake.show.drake_models import find_drake_models, runs_in_time
from lic_drake.show.pr2_meshes import DESCRIPTION

HANGING = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
open(sys.argv[1], "w").write(str(child.pid))
time.sleep(60)
"""


@pytest.fixture(autouse=True)
def _nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """An empty cache, no packages and no network."""
    go_offline(monkeypatch, tmp_path)


def refuse(line: str) -> None:
    raise AssertionError(f"a download began: {line}")


def test_a_copy_among_the_user_s_packages_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = write_drake_models(tmp_path)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'none'}:{tmp_path}")
    assert find_drake_models(say=refuse).samefile(package)


def test_what_drake_downloaded_before_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = FindResourceOrThrow("drake/multibody/parsing/drake_models.json")
    params = json.loads(Path(source).read_text())
    prefix = hashlib.sha256(params["strip_prefix"].encode()).hexdigest()
    cache = tmp_path / "cache/drake/package_map"
    cache.mkdir(parents=True)
    # Drake's name for it, and the one before.
    for name in (f"{params['sha256']}-{prefix}", params["sha256"]):
        (cache / name).symlink_to(write_drake_models(tmp_path / name[-8:]))
    monkeypatch.setenv("DRAKE_ALLOW_NETWORK", "none")
    assert (find_drake_models(say=refuse) / DESCRIPTION).is_file()
    assert os.environ["DRAKE_ALLOW_NETWORK"] == "none"


def test_offline_it_says_what_it_tried_and_leaves_no_half_a_package(tmp_path: Path) -> None:
    said: list[str] = []
    with pytest.raises(ModelError, match="could not be downloaded within 20 s; name a folder"):
        find_drake_models(20.0, said.append)
    assert said == ["downloading package://drake_models, for 20 s at most"]
    assert "DRAKE_ALLOW_NETWORK" not in os.environ
    # It is Drake that leaves a note of what it wanted to download.
    left = [path.name for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert all("README" in name for name in left)


def test_a_program_that_hangs_is_ended_with_all_it_started(tmp_path: Path) -> None:
    note = tmp_path / "child"
    began = time.monotonic()
    assert not runs_in_time([sys.executable, "-c", HANGING, str(note)], 0.5)
    assert time.monotonic() - began < 5.0
    status = Path(f"/proc/{note.read_text()}/stat")
    assert not status.exists() or status.read_text().split()[2] == "Z"


@pytest.mark.parametrize(("code", "well"), [("0", True), ("3", False)])
def test_a_program_that_ends_in_time_tells_how(code: str, well: bool) -> None:
    assert runs_in_time([sys.executable, "-S", "-c", f"raise SystemExit({code})"], 20.0) == well
