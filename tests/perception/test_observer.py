from dataclasses import replace

import numpy as np
import pytest

from lic_drake.errors import PerceptionError
from lic_drake.perception.cameras import take_views
from lic_drake.perception.config import CameraConfig, CamerasConfig, ExternalConfig, HeadConfig
from lic_drake.perception.image import disturbed_image
from lic_drake.perception.observer import Observer, board_of, starts_at
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator

CAMERA = CameraConfig(width=320, height=240, focal_px=262.5)
CAMERAS = CamerasConfig(head=HeadConfig(camera=CAMERA), external=ExternalConfig(camera=CAMERA))
SCENARIO = load_scenario("foliage-aperture-clutter", "{clutter: {num_stems: 3, num_branches: 1}}")
P_WG = np.array([0.84, -0.1, 0.9])

pytestmark = pytest.mark.usefixtures("_renderer")


def make_observer(cameras: CamerasConfig = CAMERAS) -> Observer:
    return Observer(
        scenario=SCENARIO, stream="training", environment=0, p_WG=P_WG, cameras=cameras, moves=False
    )


@pytest.fixture(scope="module")
def observer() -> Observer:
    return make_observer()


def test_each_look_has_its_own_errors(observer: Observer) -> None:
    exact = take_views(SCENARIO.sample_instance("training", 0), P_WG, CAMERAS)
    for number in (1, 0):
        look = observer.belief(number)
        for image, true, camera in ((look.head, exact.head, 0), (look.external, exact.external, 1)):
            rng = make_generator("training", "camera errors", 0, 2 * number + camera)
            expected = disturbed_image(true, CAMERA, rng)
            np.testing.assert_array_equal(image.depth, expected.depth)
            np.testing.assert_array_equal(image.color, expected.color)
            np.testing.assert_allclose(image.p_WC, expected.p_WC, atol=1e-12)
    assert observer.belief(0) is observer.belief(0)


def test_a_ball_out_of_view_is_refused() -> None:
    away = replace(CAMERAS.external, target=[2.1, 3.0, 1.0])
    with pytest.raises(PerceptionError, match="no yellow ball in view"):
        make_observer(replace(CAMERAS, external=away)).belief(0)


def test_the_robot_believes_what_it_saw(observer: Observer) -> None:
    belief = observer.belief(0)
    seen = belief.apertures
    starts, index = starts_at(SCENARIO, seen)
    # The board is where it was seen, not where it is.
    board = board_of(SCENARIO)
    shift = starts.board.aperture_centres().mean(axis=0) - seen.p_WA.mean(axis=0)
    np.testing.assert_allclose(shift, 0.0, atol=1e-9)
    assert np.linalg.norm(starts.board.aperture_centres()[0] - board.aperture_centres()[0]) > 1e-4
    # Open are those that seem so, and all others have a cover.
    np.testing.assert_array_equal(index, np.flatnonzero(seen.probability_open > 0.5))
    assert starts.instance.num_objects == board.bare_board().num_objects + 20 - len(index)
    x0 = starts.grid.x0
    nearest = np.argmin(np.linalg.norm(x0[:, None, :3] - starts.p_WA, axis=2), axis=1)
    np.testing.assert_allclose(starts.chance(x0), seen.probability_open[index][nearest])
    everywhere = belief.over_all(np.arange(len(index), dtype=float))
    np.testing.assert_array_equal(everywhere[index], np.arange(len(index)))
    assert np.isnan(everywhere).sum() == 20 - len(index)
    assert len(np.unique(belief.starts.grid.b0, axis=0)) == 1  # Its base may not move.


def test_a_board_that_seems_shut_or_far_away_is_refused(observer: Observer) -> None:
    seen = observer.belief(0).apertures
    with pytest.raises(PerceptionError, match="none of 20 apertures looks open"):
        starts_at(SCENARIO, replace(seen, probability_open=np.zeros(20)))
    with pytest.raises(PerceptionError, match="at an impossible place"):
        starts_at(SCENARIO, replace(seen, p_WA=seen.p_WA + 0.5))
