"""The diagram of cameras and detectors against its parts, called one after the other."""

import gc
import weakref
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from lic_drake.errors import PerceptionError
from lic_drake.perception.apertures import find_apertures
from lic_drake.perception.camera_station import NUM_CAMERAS, CameraStation
from lic_drake.perception.config import CameraConfig, CamerasConfig, ExternalConfig, HeadConfig
from lic_drake.perception.goal import find_goal
from lic_drake.perception.noise import disturbed_image
from lic_drake.perception.observer import board_of, estimate_board
from lic_drake.reach.scenario import load_scenario
from lic_drake.seeds import make_generator
from scripts.perception.views import take_views

CAMERA = CameraConfig(width=320, height=240, focal_px=262.5)
CAMERAS = CamerasConfig(head=HeadConfig(camera=CAMERA), external=ExternalConfig(camera=CAMERA))
SCENARIO = load_scenario("foliage-aperture-clutter", "{clutter: {num_stems: 3, num_branches: 1}}")
INSTANCE = SCENARIO.sample_instance("training", 0)
P_WG = np.array([0.84, -0.1, 0.9])
DRAW = partial(make_generator, "training", "camera errors", 0)

pytestmark = pytest.mark.usefixtures("_renderer")


@pytest.fixture(scope="module")
def station() -> CameraStation:
    return CameraStation(INSTANCE, P_WG, CAMERAS, board_of(SCENARIO), DRAW)


@pytest.mark.parametrize("number", [0, 1])
def test_a_look_is_what_cameras_errors_and_detectors_make_of_it(
    station: CameraStation, number: int
) -> None:
    look = station.look(number)
    exact = take_views(INSTANCE, P_WG, CAMERAS)
    head = disturbed_image(exact.head, CAMERA, DRAW(NUM_CAMERAS * number))
    external = disturbed_image(exact.external, CAMERA, DRAW(NUM_CAMERAS * number + 1))
    np.testing.assert_array_equal(look.head.depth, head.depth)
    np.testing.assert_array_equal(look.external.color, external.color)
    np.testing.assert_allclose(look.external.p_WC, external.p_WC, atol=1e-12)
    apertures = find_apertures(head, CAMERA, board_of(SCENARIO))
    np.testing.assert_allclose(look.apertures.p_WA, apertures.p_WA, atol=1e-9)
    goal = find_goal(external, CAMERA, CAMERAS.ball_radius_m)
    np.testing.assert_allclose(look.goal.p_WG, goal.p_WG, atol=1e-9)


def test_what_a_detector_raises_comes_out_of_the_diagram() -> None:
    away = replace(CAMERAS.external, target=[2.1, 3.0, 1.0])
    blind = CameraStation(INSTANCE, P_WG, replace(CAMERAS, external=away), board_of(SCENARIO), DRAW)
    with pytest.raises(PerceptionError, match="no yellow ball in view"):
        blind.look(0)


def test_a_lookout_dies() -> None:
    station = CameraStation(INSTANCE, P_WG, CAMERAS, board_of(SCENARIO), DRAW)
    alive = weakref.ref(station.diagram)
    del station
    gc.collect()
    assert alive() is None


def test_the_robot_believes_what_it_saw(station: CameraStation) -> None:
    look = station.look(0)
    belief = estimate_board(SCENARIO, look)
    np.testing.assert_array_equal(belief.p_WG, look.goal.p_WG)
    starts = belief.starts
    # The board is where it was seen, not where it is.
    board = board_of(SCENARIO)
    shift = starts.board.aperture_centres().mean(axis=0) - look.apertures.p_WA.mean(axis=0)
    np.testing.assert_allclose(shift, 0.0, atol=1e-9)
    assert np.linalg.norm(starts.board.aperture_centres()[0] - board.aperture_centres()[0]) > 1e-4
    # Open are those that seem so, and all others have a cover.
    assert set(belief.index) == set(np.flatnonzero(look.apertures.probability_open > 0.5))
    assert starts.instance.num_objects == board.bare_board().num_objects + 20 - len(belief.index)
    x0 = starts.grid.x0
    np.testing.assert_allclose(
        starts.chance(x0),
        look.apertures.probability_open[belief.index][
            np.argmin(np.linalg.norm(x0[:, None, :3] - starts.p_WA, axis=2), axis=1)
        ],
    )
    everywhere = belief.over_all(np.arange(len(belief.index), dtype=float))
    np.testing.assert_array_equal(everywhere[belief.index], np.arange(len(belief.index)))
    assert np.isnan(everywhere).sum() == 20 - len(belief.index)
    still = estimate_board(SCENARIO, look, moves=False)
    assert len(np.unique(still.starts.grid.b0, axis=0)) == 1


def test_a_board_that_seems_shut_is_refused(station: CameraStation) -> None:
    look = station.look(0)
    shut = replace(look, apertures=replace(look.apertures, probability_open=np.zeros(20)))
    with pytest.raises(PerceptionError, match="none of 20 apertures looks open"):
        estimate_board(SCENARIO, shut)
    away = replace(look, apertures=replace(look.apertures, p_WA=look.apertures.p_WA + 0.5))
    with pytest.raises(PerceptionError, match="at an impossible place"):
        estimate_board(SCENARIO, away)
