import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics.pairwise import laplacian_kernel

from lic_drake.estimate.kernels import l1_correlation, l1_correlation_with_gradient


def test_with_one_scale_it_is_the_laplacian_kernel_of_scikit_learn() -> None:
    rng = np.random.default_rng(0)
    A, B = rng.normal(size=(5, 4)), rng.normal(size=(3, 4))
    np.testing.assert_allclose(
        l1_correlation(A, B, np.full(4, 0.7)), laplacian_kernel(A, B, gamma=0.7)
    )


def test_its_distance_is_l1_and_not_that_of_a_matern_kernel() -> None:
    correlation = l1_correlation(np.zeros((1, 2)), np.ones((1, 2)), np.ones(2))
    assert correlation.item() == pytest.approx(np.exp(-2.0))


@given(st.integers(0, 10_000))
def test_the_gradient_equals_finite_differences_between_kinks(seed: int) -> None:
    rng = np.random.default_rng(seed)
    B, z, theta = rng.normal(size=(6, 3)), rng.normal(size=3), rng.uniform(0.1, 3.0, 3)
    step = 0.4 * np.abs(z - B).min()
    h = min(1e-6, step)
    correlation, slope = l1_correlation_with_gradient(z, B, theta)
    numeric = [
        (l1_correlation([z + h * e], B, theta) - l1_correlation([z - h * e], B, theta))[0] / (2 * h)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(correlation, l1_correlation(z[None], B, theta)[0])
    np.testing.assert_allclose(slope, np.transpose(numeric), atol=1e-6, rtol=1e-4)


def test_at_a_kink_the_gradient_is_the_mean_of_both_sides() -> None:
    _, slope = l1_correlation_with_gradient(
        np.array([0.5, 1.0]), np.array([[0.5, 0.0]]), np.ones(2)
    )
    assert slope[0, 0] == 0.0
    assert slope[0, 1] == pytest.approx(-np.exp(-1.0))
