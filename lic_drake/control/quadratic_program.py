"""Small strictly convex quadratic programs, solved by the dual active-set method of DAQP.

The controller's programs have few variables and cost terms that differ by six orders of
magnitude, at which interior-point solvers with absolute tolerances give up (Drake's Clarabel:
"InsufficientProgress" in thousands of steps of the 100 Hz preset). An active set is exact.
DAQP: Arnstrom, Bemporad and Axehill, A Dual Active-Set Solver for Embedded Quadratic
Programming Using Recursive LDL' Updates, IEEE TAC 2022.
"""

from typing import NamedTuple

import daqp
import numpy as np

from lic_drake.types import Vector

PRIMAL_TOLERANCE = 1e-10
"""How far a limit may be missed, in the rows' units over their length."""

OPTIMAL, INFEASIBLE = 1, -1
"""DAQP's exit flags."""


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
        numpy.linalg.LinAlgError: P is not positive definite, or the solver gave up.
    """
    # The first limits, for which A has no rows, are those of the variables.
    x: Vector
    x, _, flag, _ = daqp.solve(
        problem.P,
        problem.c,
        problem.A,
        np.concatenate((problem.x_max, problem.row_max)),
        np.concatenate((problem.x_min, problem.row_min)),
        primal_tol=PRIMAL_TOLERANCE,
    )
    if flag == OPTIMAL:
        return x
    if flag == INFEASIBLE:
        return None
    raise np.linalg.LinAlgError(f"DAQP ended with flag {flag}")
