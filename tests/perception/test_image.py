from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ray_casting import blank, tilted

from lic_drake.perception.config import CameraConfig, NoiseConfig, PoseErrorConfig
from lic_drake.perception.image import add_depth_noise, disturbed_image, pose_covariance

CLEAN = NoiseConfig(
    depth_sigma_per_m=0.0, depth_step_per_m=0.0, dropout=0.0, edge_dropout=0.0, color_sigma=0.0
)


@given(st.floats(-60, 60), st.floats(-180, 180), st.integers(0, 319), st.integers(0, 239))
def test_the_ray_of_a_pixel_is_drawn_at_that_pixel(
    tilt: float, pan: float, column: int, row: int
) -> None:
    image = blank(tilted(tilt, pan), np.array([0.3, -0.2, 1.4]))
    p_WQ = image.p_WC + image.R_WC @ (1.7 * image.rays()[row, column])
    np.testing.assert_allclose(image.project(p_WQ[None]), [[column, row]], atol=1e-9)


@pytest.mark.parametrize("z", [1.0, 2.0, 4.0])
def test_the_random_error_grows_with_the_depth_squared(z: float) -> None:
    config = replace(CLEAN, depth_sigma_per_m=1.425e-3)
    measured = add_depth_noise(np.full((300, 400), z), config, np.random.default_rng(0))
    assert measured.std() == pytest.approx(1.425e-3 * z**2, rel=0.02)
    assert measured.mean() == pytest.approx(z, abs=1e-3)


def test_depths_come_in_steps_that_grow_with_the_depth_squared() -> None:
    config = replace(CLEAN, depth_step_per_m=2.85e-3)
    true = np.linspace(1.0, 4.0, 100_000)[np.newaxis]
    levels = np.unique(add_depth_noise(true, config, np.random.default_rng(0)))
    steps = np.diff(levels)
    np.testing.assert_allclose(steps, 2.85e-3 * levels[:-1] * levels[1:], rtol=1e-6)
    assert np.abs(add_depth_noise(true, config, np.random.default_rng(0)) - true).max() < 0.025


def test_depth_is_lost_at_random_and_more_so_where_it_jumps() -> None:
    depth = np.full((200, 400), 1.0)
    depth[:, 200:] = 1.5
    config = replace(CLEAN, dropout=0.02, edge_dropout=0.5)
    lost = np.isnan(add_depth_noise(depth, config, np.random.default_rng(0)))
    assert lost[:, 199:201].mean() == pytest.approx(0.5, abs=0.08)
    assert lost[:, :199].mean() == pytest.approx(0.02, abs=0.005)
    nothing = np.full((5, 5), np.nan)
    assert np.all(np.isnan(add_depth_noise(nothing, config, np.random.default_rng(0))))


def test_colours_are_noisy_and_keep_to_their_range() -> None:
    image = blank(tilted(0.0), np.zeros(3), width=50, height=50)
    image.color[:25], image.color[25:] = 0, 255
    camera = CameraConfig(noise=replace(CLEAN, color_sigma=10.0))
    noisy = disturbed_image(image, camera, np.random.default_rng(0)).color
    assert noisy.dtype == np.uint8
    assert noisy[:25].max() < 60 and noisy[25:].min() > 195
    assert noisy[:25].std() > 2.0


def test_the_covariance_of_a_point_is_what_many_wrong_poses_scatter_it_by() -> None:
    camera = CameraConfig(
        noise=CLEAN, pose_error=PoseErrorConfig(translation_m=0.01, rotation_deg=1)
    )
    image = blank(tilted(20.0, 30.0), np.array([0.1, 0.2, 1.0]), width=32, height=24)
    p_CQ = np.array([0.3, -0.2, 1.5])
    rng = np.random.default_rng(0)
    believed = [disturbed_image(image, camera, rng) for _ in range(1500)]
    p_WQ = np.array([view.p_WC + view.R_WC @ p_CQ for view in believed])
    expected = pose_covariance(image.R_WC @ p_CQ, camera.pose_error)
    np.testing.assert_allclose(np.cov(p_WQ.T), expected, atol=0.1 * np.trace(expected))
    np.testing.assert_allclose(believed[0].R_WC @ believed[0].R_WC.T, np.eye(3), atol=1e-12)
