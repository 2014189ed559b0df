"""The absolute-exponential correlation exp(-sum_i theta_i |d_i|) of paper III-D.

Its distance is the weighted L1 norm. (A Matern kernel with nu = 1/2 uses the L2 norm instead and
is another model.) It has a kink wherever a feature equals that of a training row.
"""

import numpy as np
from scipy.spatial.distance import cdist

from lic_drake.types import Vector


def l1_correlation(A: Vector, B: Vector, theta: Vector) -> Vector:
    """Returns the correlations of rows of A, shape (n, d), with rows of B, shape (m, d).

    Args:
        A: Feature vectors.
        B: Feature vectors.
        theta: Decay per unit of each feature, shape (d,), positive.

    Returns:
        Shape (n, m).
    """
    correlation: Vector = np.exp(-cdist(A * theta, B * theta, "cityblock"))
    return correlation


def l1_correlation_with_gradient(z: Vector, B: Vector, theta: Vector) -> tuple[Vector, Vector]:
    """Returns the correlations of z with rows of B, shape (m,), and their derivatives by z.

    Args:
        z: Feature vector, shape (d,).
        B: Feature vectors, shape (m, d).
        theta: Decay per unit of each feature, shape (d,), positive.

    Returns:
        Correlations, shape (m,), and derivatives, shape (m, d); at a kink the mean of both
        sides' derivatives.
    """
    difference = z - B
    correlation = np.exp(-(np.abs(difference) @ theta))
    return correlation, -theta * np.sign(difference) * correlation[:, None]
