from pathlib import Path

import pytest

from lic_drake.errors import ScenarioError
from lic_drake.perception.config import (
    CamerasConfig,
    ExternalConfig,
    load_cameras,
)


def test_the_shipped_cameras_are_the_defaults() -> None:
    assert load_cameras() == CamerasConfig()


def test_a_file_of_ones_own_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("{head: {tilt_deg: 30.0, camera: {noise: {dropout: 0.2}}}}")
    cameras = load_cameras(path)
    assert cameras.head.tilt_deg == 30.0
    assert cameras.head.camera.noise.dropout == 0.2
    assert cameras.external == ExternalConfig()


def test_unknown_cameras_are_named() -> None:
    with pytest.raises(ScenarioError, match="no cameras 'none'; shipped cameras: foliage"):
        load_cameras("none")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{head: {tilt: 30.0}}", r"mine\.yaml.*tilt"),
        ("{head: {camera: {width: 5}}}", "width must be from 16 to 4096, got 5"),
        ("{head: {camera: {nearest_m: 6.0}}}", "furthest_m must be from 6"),
        ("{external: {p_WC: [0.84, -0.29, 3.0]}}", "cannot look straight up or down"),
    ],
)
def test_keys_and_values_that_make_no_sense_are_refused(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=message):
        load_cameras(path)
