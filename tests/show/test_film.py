from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lic_drake.errors import LicError
from lic_drake.perception.cameras import take_views
from lic_drake.perception.config import CameraConfig, CamerasConfig, ExternalConfig, HeadConfig
from lic_drake.reach.scenario import load_scenario
from lic_drake.reach.trace import ReachTrace, SceneState
from lic_drake.robots.pr2 import RIGHT_ARM_AT_REST
from lic_drake.show.figures import ShownTrial
from lic_drake.show.film import SHRINK, film_frames, save_film


@pytest.mark.usefixtures("_renderer")
def test_a_film_shows_what_the_cameras_see_from_where_the_robot_is() -> None:
    camera = CameraConfig(width=320, height=240, focal_px=262.5)
    head = HeadConfig(camera=camera)
    cameras = CamerasConfig(head=head, external=ExternalConfig(camera=camera))
    scenario = load_scenario(
        "foliage-aperture-clutter", "{clutter: {num_stems: 2, num_branches: 1}}"
    )
    instance, p_WG = scenario.sample_instance("training", 0), np.array([0.84, -0.1, 0.9])
    bent = SceneState(
        q=RIGHT_ARM_AT_REST, v=np.zeros(7), q_clutter=np.zeros((2, 2)), v_clutter=np.zeros((2, 2))
    )
    looking, near = ReachTrace(), ReachTrace()
    for trace, x in ((looking, -1.0), (near, 0.0)):
        trace.b0 = np.array([x, -0.29, head.torso_m])
        trace.states.append(bent)
    trial = ShownTrial(
        scenario=scenario, instance=instance, p_WG=p_WG, attempts=[], traces=[looking, near]
    )
    frame, nearer = film_frames(trial, cameras)
    assert frame.shape == (240 // SHRINK, 2 * 320 // SHRINK, 3)
    views = take_views(instance, p_WG, cameras)
    expected = np.hstack([views.head.color, views.external.color])[::SHRINK, ::SHRINK]
    np.testing.assert_array_equal(frame, expected)
    assert np.mean(np.abs(nearer.astype(float) - frame).max(axis=2) > 25.0) > 0.15


def test_a_film_has_its_frames(tmp_path: Path) -> None:
    frames = [np.full((20, 40, 3), shade, dtype=np.uint8) for shade in (0, 100, 200)]
    path = tmp_path / "film.webp"
    save_film(frames, path)
    with Image.open(path) as film:
        assert film.n_frames == 3 and film.size == (40, 20)
    with pytest.raises(LicError, match="cannot write"):
        save_film(frames, tmp_path / "missing" / "film.webp")
