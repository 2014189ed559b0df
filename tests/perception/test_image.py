import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.ray_casting import blank, tilted


@given(st.floats(-60, 60), st.floats(-180, 180), st.integers(0, 319), st.integers(0, 239))
def test_the_ray_of_a_pixel_is_drawn_at_that_pixel(
    tilt: float, pan: float, column: int, row: int
) -> None:
    image = blank(tilted(tilt, pan), np.array([0.3, -0.2, 1.4]))
    p_WQ = image.p_WC + image.R_WC @ (1.7 * image.rays()[row, column])
    np.testing.assert_allclose(image.project(p_WQ[None]), [[column, row]], atol=1e-9)


def test_the_optical_axis_is_in_the_middle_of_the_image() -> None:
    image = blank(np.eye(3), np.zeros(3), width=320, height=240)
    np.testing.assert_allclose(image.project(np.array([[0.0, 0.0, 2.0]])), [[159.5, 119.5]])
    np.testing.assert_allclose(image.rays().mean(axis=(0, 1)), [0.0, 0.0, 1.0], atol=1e-12)
