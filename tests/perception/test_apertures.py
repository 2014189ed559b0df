from dataclasses import replace

import numpy as np
import pytest
from support.ray_casting import OTHER, blank, draw_boxes, draw_instance, tilted

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.foliage import FoliageApertureClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import PerceptionError
from lic_drake.perception.apertures import DetectedApertures, find_apertures
from lic_drake.perception.config import CameraConfig, PoseErrorConfig
from lic_drake.perception.image import CameraImage, disturbed_image
from lic_drake.seeds import make_generator
from scripts.perception.errors import true_states

BARE = FoliageApertureClutter(num_stems=0, num_branches=0, leaves_per_stem=0)
CAMERA = CameraConfig(pose_error=PoseErrorConfig(translation_m=0.0, rotation_deg=0.0))
P_WC = np.array([-0.9, -0.19, 1.4])


def draw(clutter: FoliageApertureClutter, index: int = 0) -> ClutterInstance:
    return clutter.sample(make_generator("training", "bare", index))


def look(
    instance: ClutterInstance,
    R_WC: np.ndarray | None = None,
    p_WC: np.ndarray = P_WC,
    width: int = 320,
) -> CameraImage:
    image = blank(tilted(18.0) if R_WC is None else R_WC, p_WC, width, 3 * width // 4)
    draw_instance(image, instance)
    return image


def find(image: CameraImage, clutter: FoliageApertureClutter = BARE) -> DetectedApertures:
    # Nothing of the board is used but its rows, columns and spacing.
    known = ApertureBoard(
        board_centre=[9.0, 9.0, 9.0],
        rows=clutter.rows,
        columns=clutter.columns,
        aperture_m=clutter.aperture_m,
    )
    return find_apertures(image, CAMERA, known)


@pytest.mark.parametrize("index", range(2))
def test_apertures_are_found_where_they_are_and_as_they_are(index: int) -> None:
    instance = draw(BARE, index)
    found = find(look(instance))
    np.testing.assert_allclose(found.p_WA, BARE.aperture_centres(), atol=0.003)
    assert found.states == true_states(BARE, instance)
    opened = np.array([state == "open" for state in found.states])
    np.testing.assert_array_equal(found.probability_open > 0.5, opened)
    corner = found.corners - [BARE.board_centre[0] - 0.5 * BARE.bar_m, 0.0, 0.0]
    np.testing.assert_allclose(corner[..., 0], 0.0, atol=0.003)
    sides = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
    np.testing.assert_allclose(sides, BARE.aperture_m - BARE.bar_m, atol=0.005)


@pytest.mark.parametrize(
    ("tilt", "pan", "roll", "p_WC"),
    [
        (0.0, 0.0, 0.0, (-1.2, -0.19, 0.94)),
        (25.0, -25.0, 8.0, (-0.7, 0.5, 1.5)),
        (-15.0, 10.0, -5.0, (-1.0, -0.5, 0.6)),
    ],
)
def test_the_board_is_found_from_elsewhere(
    tilt: float, pan: float, roll: float, p_WC: tuple[float, ...]
) -> None:
    instance = draw(BARE)
    found = find(look(instance, tilted(tilt, pan, roll), np.array(p_WC)))
    np.testing.assert_allclose(found.p_WA, BARE.aperture_centres(), atol=0.004)
    assert found.states == true_states(BARE, instance)


def test_other_boards_are_found_by_their_rows_columns_and_size() -> None:
    other = replace(BARE, rows=3, columns=4, aperture_m=0.25, bar_m=0.03, num_blocked=3)
    instance = draw(other)
    found = find(look(instance), other)
    np.testing.assert_allclose(found.p_WA, other.aperture_centres(), atol=0.006)
    assert found.states == true_states(other, instance)


def test_errors_of_noisy_depths_are_as_large_as_the_covariances_say() -> None:
    instance = draw(BARE)
    image = look(instance, width=480)
    camera = CameraConfig()
    off, squared = [], []
    for index in range(3):
        noisy = disturbed_image(image, camera, np.random.default_rng(index))
        found = find_apertures(noisy, camera, BARE)
        assert found.states == true_states(BARE, instance)
        error = found.p_WA - BARE.aperture_centres()
        off.append(np.linalg.norm(error, axis=1))
        squared += [e @ np.linalg.solve(c, e) for e, c in zip(error, found.covariance, strict=True)]
    assert np.median(off) < 0.01
    assert 1.0 < np.mean(squared) < 8.0  # 3 expected; the 20 errors of a look are nearly the same.


def test_what_is_not_seen_of_an_aperture_is_as_likely_open_as_not() -> None:
    instance = draw(replace(BARE, num_blocked=0, num_partly_covered=0))
    image = look(instance)
    # Something between camera and board hides the aperture in the middle of the upper row.
    hidden = BARE.aperture_centres()[17]
    before = image.p_WC + 0.5 * (hidden - image.p_WC)
    draw_boxes(image, before[None], np.array([[0.01, 0.11, 0.11]]), [OTHER])
    found = find(image)
    assert found.states[17] == "unseen"
    assert found.probability_open[17] == pytest.approx(0.5, abs=0.05)
    others = np.delete(np.arange(20), [12, 16, 17, 18])
    assert {found.states[i] for i in others} == {"open"}
    assert found.probability_open[others].min() > 0.95


def test_what_is_far_behind_the_board_covers_nothing_though_nothing_is_measured_there() -> None:
    instance = draw(replace(BARE, num_blocked=0, num_partly_covered=0))
    assert set(find(look(instance)).states) == {"open"}  # Nothing at all is behind it.
    image = look(instance)
    draw_boxes(image, np.array([[0.6, -0.19, 0.94]]), np.array([[0.02, 2.0, 2.0]]), [OTHER])
    assert set(find(image).states) == {"open"}


def test_an_image_without_a_board_is_refused() -> None:
    with pytest.raises(PerceptionError, match="no board in view: 0 brown pixels"):
        find(blank(tilted(18.0), P_WC))
    image = blank(tilted(18.0), P_WC)
    draw_boxes(image, np.array([[0.5, -0.19, 0.94]]), np.array([[0.02, 0.1, 2.0]]), [(110, 69, 36)])
    with pytest.raises(PerceptionError, match="no board of 4 x 5 apertures"):
        find(image)
