"""Whether a point is the optimum of a quadratic program, without a solver."""

import numpy as np

from lic_drake.control.quadratic_program import QuadraticProgram


def violation(problem: QuadraticProgram, x: np.ndarray) -> float:
    """By how much the worst limit is broken, with rows longer than 1 scaled to 1; 0 if none is."""
    rows, low, high = _all_rows(problem)
    excess = np.maximum(np.maximum(low - rows @ x, rows @ x - high), 0.0)
    return float(np.max(excess / np.maximum(np.linalg.norm(rows, axis=1), 1.0)))


def kkt_residual(problem: QuadraticProgram, x: np.ndarray, active: float = 1e-7) -> float:
    """How far the cost's gradient is from the cone of the active limits' normals, relative.

    The multipliers come from a non-negative fit by projected coordinate descent, not from the
    solver under test.
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
    multipliers = np.zeros(len(inward))
    residual = gradient.copy()
    for _ in range(20_000):
        before = multipliers.copy()
        for i, row in enumerate(inward):
            multiplier = max(0.0, multipliers[i] + row @ residual)
            residual -= (multiplier - multipliers[i]) * row
            multipliers[i] = multiplier
        if np.max(np.abs(multipliers - before), initial=0.0) < 1e-13 * scale:
            break
    return float(np.linalg.norm(residual) / scale)


def _all_rows(problem: QuadraticProgram) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, lower and upper limits, the variables' own bounds among them."""
    return (
        np.vstack([problem.A, np.eye(len(problem.c))]),
        np.concatenate([problem.row_min, problem.x_min]),
        np.concatenate([problem.row_max, problem.x_max]),
    )
