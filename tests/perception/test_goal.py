import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.ray_casting import OTHER, blank, draw_ball, draw_boxes, tilted

from lic_drake.errors import PerceptionError
from lic_drake.perception.config import CameraConfig, PoseErrorConfig
from lic_drake.perception.goal import find_goal
from lic_drake.perception.image import CameraImage, disturbed_image

RADIUS = 0.03
R_WC, P_WC = tilted(25.0, 140.0), np.array([2.1, -0.9, 1.5])
EXACT = CameraConfig(pose_error=PoseErrorConfig(translation_m=0.0, rotation_deg=0.0))


def at(x: float, y: float, z: float) -> np.ndarray:
    """A point in the camera's frame, in W."""
    return np.asarray(P_WC + R_WC @ np.array([x, y, z]))


def look(p_WG: np.ndarray, width: int = 320) -> CameraImage:
    image = blank(R_WC, P_WC, width, 3 * width // 4)
    draw_ball(image, p_WG, RADIUS)
    return image


@settings(max_examples=15)
@given(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(0.8, 2.0))
def test_a_ball_is_found_anywhere_in_view(x: float, y: float, z: float) -> None:
    p_WG = at(x * z, y * z, z)
    found = find_goal(look(p_WG), EXACT, RADIUS)
    np.testing.assert_allclose(found.p_WG, p_WG, atol=1e-4)


def test_leaves_before_the_ball_do_not_shift_it() -> None:
    p_WG = at(0.1, -0.05, 1.6)
    image = look(p_WG)
    draw_boxes(image, (p_WG + [0.05, 0.0, 0.02])[None], np.array([[0.01, 0.1, 0.03]]), [OTHER])
    ball = look(p_WG).depth
    assert np.sum(np.abs(image.depth - ball) > 0.01) > 0.25 * np.isfinite(ball).sum()
    np.testing.assert_allclose(find_goal(image, EXACT, RADIUS).p_WG, p_WG, atol=1e-3)


def test_of_two_yellow_spots_the_larger_is_the_ball() -> None:
    p_WG = at(0.1, -0.05, 1.6)
    image = look(p_WG)
    draw_ball(image, at(-0.4, 0.1, 1.6), 0.01)
    np.testing.assert_allclose(find_goal(image, EXACT, RADIUS).p_WG, p_WG, atol=1e-4)


@pytest.mark.parametrize("with_pose", [False, True])
def test_errors_of_noisy_images_are_as_large_as_the_covariance_says(with_pose: bool) -> None:
    p_WG = at(0.1, -0.05, 1.6)
    image = look(p_WG)
    camera = CameraConfig() if with_pose else EXACT
    squared, off = [], []
    for index in range(15):
        noisy = disturbed_image(image, camera, np.random.default_rng(index))
        found = find_goal(noisy, camera, RADIUS)
        error = found.p_WG - p_WG
        off.append(np.linalg.norm(error))
        squared.append(error @ np.linalg.solve(found.covariance, error))
    assert np.median(off) < (0.01 if with_pose else 0.003)
    # 3 expected, and less without errors of the pose: the rim does not count for the covariance.
    assert 1.0 < np.mean(squared) < 6.0


def test_without_a_ball_that_is_said() -> None:
    with pytest.raises(PerceptionError, match="largest yellow spot has 0 pixels with depth"):
        find_goal(blank(R_WC, P_WC), EXACT, RADIUS)
