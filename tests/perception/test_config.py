from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lic_drake.errors import ScenarioError
from lic_drake.perception.config import (
    CameraConfig,
    CamerasConfig,
    ExternalConfig,
    NoiseConfig,
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


def test_unknown_files_and_keys_are_named(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no cameras 'none'; shipped cameras: foliage"):
        load_cameras("none")
    path = tmp_path / "typo.yaml"
    path.write_text("{head: {tilt: 30.0}}")
    with pytest.raises(ScenarioError, match=r"typo\.yaml.*tilt"):
        load_cameras(path)
    path.write_text("{head: {camera: {width: 5}}}")
    with pytest.raises(ScenarioError, match="width must be from 16 to 4096, got 5"):
        load_cameras(path)


@pytest.mark.parametrize(
    ("config", "values", "message"),
    [
        (NoiseConfig(), {"dropout": 1.5}, "dropout must be from 0 to 1, got 1.5"),
        (CameraConfig(), {"nearest_m": 6.0}, "furthest_m must be from 6"),
        (ExternalConfig(), {"p_WC": [0.84, -0.29, 3.0]}, "cannot look straight up or down"),
    ],
)
def test_values_that_make_no_sense_are_refused(
    config: Any, values: dict[str, Any], message: str
) -> None:
    with pytest.raises(ScenarioError, match=message):
        replace(config, **values)
