"""Rendered images against rays that are intersected without a renderer."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.ray_casting import blank, draw_ball, draw_instance, tilted

from lic_drake.cli.main import main
from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.errors import RenderingError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.perception.cameras import Views, take_views
from lic_drake.perception.config import CameraConfig, CamerasConfig, ExternalConfig, HeadConfig
from lic_drake.seeds import make_generator

CAMERA = CameraConfig(width=320, height=240, focal_px=262.5)
CAMERAS = CamerasConfig(head=HeadConfig(camera=CAMERA), external=ExternalConfig(camera=CAMERA))
CLUTTER = FoliageApertureClutter(num_stems=3, num_branches=1)
INSTANCE = CLUTTER.sample(make_generator("training", "views", 0))
P_WG = np.array([0.84, -0.1, 0.9])

pytestmark = pytest.mark.usefixtures("_renderer")


@pytest.fixture(scope="module")
def views() -> Views:
    return take_views(INSTANCE, P_WG, CAMERAS)


def test_the_head_looks_from_where_it_says_and_sees_the_board(views: Views) -> None:
    head = views.head
    np.testing.assert_allclose(head.R_WC, tilted(18.0), atol=1e-9)
    expected = blank(head.R_WC, head.p_WC)
    draw_instance(expected, replace(INSTANCE, stems=None))
    near = np.isfinite(expected.depth) & np.isfinite(head.depth)
    same = np.abs(head.depth - expected.depth)[near] < 2e-3
    # Stems stand before nothing of the board, so only pixels on edges may differ.
    assert near.sum() > 8000
    assert same.mean() > 0.98
    # Nothing of the robot, and the foliage is further away than the board.
    assert np.nanmin(head.depth) > 1.2
    green = head.color[..., 1] > 1.3 * head.color[..., 0].astype(float)
    assert green.sum() > 50


def test_the_external_camera_sees_the_ball_where_it_is(views: Views) -> None:
    image = views.external
    expected = blank(image.R_WC, image.p_WC)
    draw_ball(expected, P_WG, CAMERAS.ball_radius_m)
    ball = np.isfinite(expected.depth)
    yellow = image.color[..., 2] < 0.4 * image.color[..., 0]
    assert (ball & yellow).sum() > 0.8 * ball.sum()
    off = np.abs(image.depth - expected.depth)[ball & yellow]
    assert np.median(off) < 1e-3
    column, row = image.project(P_WG[None])[0]
    rows, columns = np.nonzero(ball)
    assert abs(columns.mean() - column) < 1.0
    assert abs(rows.mean() - row) < 1.0


def test_without_graphics_libraries_it_is_said_what_to_install(tmp_path: Path) -> None:
    for name in ("libEGL.so.1", "libEGL.so"):
        (tmp_path / name).touch()
    script = "from lic_drake.perception.cameras import make_renderer; make_renderer()"
    result = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "LD_LIBRARY_PATH": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert result.returncode == 1
    last = result.stderr.splitlines()[-1]
    assert "RenderingError: cameras cannot be simulated: " in last
    assert last.endswith("apt-get install libegl1 libgl1 libgl1-mesa-dri")


def test_without_cameras_the_foliage_demo_is_refused_in_one_line_before_it_learns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail() -> None:
        raise RenderingError("cameras cannot be simulated: it is dark")

    monkeypatch.setattr("lic_drake.show.demonstration.make_renderer", fail)
    monkeypatch.setattr(ExperienceLibrary, "columns", lambda library: pytest.fail("it learns"))
    demo = ["demo", "--robot", "pr2", "--category", "foliage-aperture-clutter"]
    assert main([*demo, "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr() == ("", "lic: error: cameras cannot be simulated: it is dark\n")
