"""Whether a point is the optimum of a quadratic program, without a solver."""

import numpy as np
from scipy.optimize import linprog, lsq_linear

from lic_drake.control.mpc import QuadraticProgram


def violation(problem: QuadraticProgram, x: np.ndarray) -> float:
    """By how much the worst limit is broken, with rows longer than 1 scaled to 1; 0 if none is."""
    rows, low, high = _all_rows(problem)
    excess = np.maximum(np.maximum(low - rows @ x, rows @ x - high), 0.0)
    return float(np.max(excess / np.maximum(np.linalg.norm(rows, axis=1), 1.0)))


def kkt_residual(problem: QuadraticProgram, x: np.ndarray, active: float = 1e-7) -> float:
    """How far the cost's gradient is from the cone of the active limits' normals, relative.

    The multipliers come from a bounded least-squares fit, not from the solver under test.
    """
    gradient = problem.P @ x + problem.c
    rows, low, high = _all_rows(problem)
    norms = np.linalg.norm(rows, axis=1)
    rows, low, high, norms = (item[norms > 1e-9] for item in (rows, low, high, norms))
    units, value = rows / norms[:, None], rows @ x
    inward = np.vstack(
        [
            units[np.abs(value - low) < active * norms],
            -units[np.abs(value - high) < active * norms],
        ]
    )
    scale = np.linalg.norm(gradient) + np.linalg.norm(problem.c)
    if len(inward) == 0:
        return float(np.linalg.norm(gradient) / scale)
    fit = lsq_linear(inward.T, gradient, (0.0, np.inf), "bvls")
    return float(np.linalg.norm(inward.T @ fit.x - gradient) / scale)


def largest_margin(problem: QuadraticProgram) -> float:
    """By how much all limits, of rows scaled to 1, can be kept at once; negative if they cannot."""
    rows, low, high = _all_rows(problem)
    norms = np.linalg.norm(rows, axis=1)
    empty = norms < 1e-9
    if np.any(low[empty] > 0.0) or np.any(high[empty] < 0.0):
        return -np.inf
    rows, low, high, norms = (item[~empty] for item in (rows, low, high, norms))
    units, low, high = rows / norms[:, None], low / norms, high / norms
    left = np.vstack([units[np.isfinite(high)], -units[np.isfinite(low)]])
    right = np.concatenate([high[np.isfinite(high)], -low[np.isfinite(low)]])
    free = [(None, None)] * rows.shape[1]
    result = linprog(
        np.append(np.zeros(rows.shape[1]), -1.0),
        np.column_stack([left, np.ones(len(left))]),
        right,
        bounds=[*free, (None, 1.0)],
    )
    return float(-result.fun)


def _all_rows(problem: QuadraticProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, lower and upper limits, the variables' own bounds among them."""
    rows = np.vstack([np.eye(len(problem.c)), problem.A])
    return rows, problem.lower, problem.upper
