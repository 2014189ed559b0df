"""A machine without graphics libraries."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
from lic_drake.errors import LicError
from scripts.perception.errors import measure_scene
from lic_drake.perception.config import load_cameras
from lic_drake.reach.scenario import load_scenario
scenario = load_scenario("foliage-aperture-clutter")
print("open", len(scenario.sample_instance("training", 0).p_WA))
try:
    measure_scene(scenario, load_cameras(), 0)
except LicError as error:
    print(type(error).__name__, error)
"""


@pytest.mark.slow
def test_the_foliage_demo_is_refused_in_one_line_before_it_learns(tmp_path: Path) -> None:
    for name in ("libEGL.so.1", "libEGL.so"):
        (tmp_path / name).touch()
    demo = ["demo", "--robot", "pr2", "--category", "foliage-aperture-clutter"]
    result = subprocess.run(
        [sys.executable, "-m", "lic_drake", *demo, "--out", str(tmp_path / "out")],
        env={**os.environ, "LD_LIBRARY_PATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr.startswith("lic: error: cameras cannot be simulated: ")
    assert result.stderr.endswith("apt-get install libegl1 libgl1 libgl1-mesa-dri\n")
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "files", [("libEGL.so.1", "libEGL.so"), ("libGL.so.1", "libGL.so", "libGLdispatch.so.0")]
)
def test_without_a_graphics_library_the_rest_works_and_a_message_says_what_to_install(
    files: tuple[str, ...], tmp_path: Path
) -> None:
    # An empty file before the system's library: the loader finds it, and cannot use it.
    for name in files:
        (tmp_path / name).touch()
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        env={**os.environ, "LD_LIBRARY_PATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 0, result.stderr
    first, second, *_ = result.stdout.splitlines()
    assert first == "open 12"
    assert second.startswith("RenderingError cameras cannot be simulated: ")
    assert second.endswith("apt-get install libegl1 libgl1 libgl1-mesa-dri")
