"""Small strictly convex quadratic programs, solved exactly as least-distance problems.

The controller's programs have few variables and cost terms that differ by six orders of
magnitude, at which interior-point solvers with absolute tolerances give up (Drake's Clarabel:
"InsufficientProgress" in thousands of steps of the 100 Hz preset). With the cost's Cholesky
factor the problem becomes that of the point nearest to the origin in a polyhedron, which
non-negative least squares solves in a finite number of steps (Lawson and Hanson, Solving Least
Squares Problems, ch. 23).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dtrtri
from scipy.optimize import nnls

Vector = NDArray[np.float64]

_SCALES = (1.0, 1e3, 1e6)
"""Units for distances, tried in turn: the dual problem resolves up to about 1e4 of one."""

_TOLERANCE = 1e-8
"""An answer keeps its limits to this part of its distance, or there is none."""


class QuadraticProgram(NamedTuple):
    """Minimise 1/2 x'Px + c'x subject to row_min <= Ax <= row_max and x_min <= x <= x_max.

    Attributes:
        P: Positive definite, shape (n, n).
        c: Shape (n,).
        A: Shape (k, n), k may be 0.
        row_min: Shape (k,), may hold -inf.
        row_max: Shape (k,), may hold inf.
        x_min: Shape (n,), may hold -inf.
        x_max: Shape (n,), may hold inf.
    """

    P: Vector
    c: Vector
    A: Vector
    row_min: Vector
    row_max: Vector
    x_min: Vector
    x_max: Vector


def solve(problem: QuadraticProgram) -> Vector | None:
    """Returns the minimiser, shape (n,), or None when the constraints contradict each other.

    Where they leave no more than a single point, rounding decides between it and None.

    Raises:
        numpy.linalg.LinAlgError: P is not positive definite.
    """
    # With P = L L', y = L'x - y_free has the cost 1/2 |y|^2; y_free is the free optimum.
    L, failed = dpotrf(problem.P, lower=True)
    if failed:
        raise np.linalg.LinAlgError("the cost of a quadratic program is not positive definite")
    L_inv, _ = dtrtri(L, lower=True)
    y_free = -L_inv @ problem.c
    rows = np.concatenate((problem.A @ L_inv.T, L_inv.T))
    G = np.concatenate((rows, -rows))
    h = np.concatenate((problem.row_min, problem.x_min, -problem.row_max, -problem.x_max))
    h -= G @ y_free
    norms = np.sqrt(np.vecdot(G, G))
    empty = norms < 1e-12
    if empty.any() and (h[empty] > 1e-12).any():
        return None
    used = (h != -np.inf) & ~empty
    G, h, norms = G[used], h[used], norms[used]
    y = _nearest_to_origin(G / norms[:, None], h / norms)
    return None if y is None else L_inv.T @ (y + y_free)


def _nearest_to_origin(G: Vector, h: Vector) -> Vector | None:
    """Returns the shortest y with G y >= h, rows of G of unit length, or None."""
    n = G.shape[1]
    if len(h) == 0 or (worst := float(h.max())) <= 0.0:
        return np.zeros(n)
    f = np.zeros(n + 1)
    f[n] = 1.0
    for scale in _SCALES:
        unit = scale * worst
        E = np.concatenate((G.T, h[None] / unit))
        multipliers, _ = nnls(E, f, maxiter=100 * len(h))
        residual = E @ multipliers - f
        # The residual is zero, but for rounding, when the constraints contradict each other.
        if residual[-1] < 0.0:
            y: Vector = residual[:-1] * (-unit / residual[-1])
            size = math.sqrt(y @ y)
            if (h - G @ y).max() <= _TOLERANCE * max(worst, size):
                return y
    return None
