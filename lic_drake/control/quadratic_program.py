"""Small convex quadratic programs, solved with Clarabel through Drake."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.solvers import ClarabelSolver, MathematicalProgram

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class QuadraticProgram:
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


_SOLVER = ClarabelSolver()


def solve(problem: QuadraticProgram, scale: float) -> Vector | None:
    """Returns the minimiser, shape (n,), or None when the constraints contradict each other.

    Args:
        problem: The program.
        scale: Typical size of x. The solver's tolerances are absolute, so the program is posed in
            x / scale and its cost divided by scale^2.
    """
    if np.any(problem.row_min > problem.row_max) or np.any(problem.x_min > problem.x_max):
        return None
    program = MathematicalProgram()
    x = program.NewContinuousVariables(len(problem.c))
    program.AddQuadraticCost(problem.P, problem.c / scale, x, is_convex=True)
    program.AddBoundingBoxConstraint(problem.x_min / scale, problem.x_max / scale, x)
    if len(problem.A):
        program.AddLinearConstraint(
            problem.A, problem.row_min / scale, problem.row_max / scale, x
        )
    result = _SOLVER.Solve(program)
    if not result.is_success():
        return None
    return np.asarray(result.GetSolution(x)) * scale
