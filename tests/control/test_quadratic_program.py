import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from support.optimality import kkt_residual, largest_margin, violation

from lic_drake.control.mpc import QuadraticProgram, solve


def random_problem(rng: np.random.Generator, scale: float = 1.0) -> QuadraticProgram:
    """A program as the controller makes them: few variables, rows, bounds, some limits off."""
    n, k = int(rng.integers(2, 6)), int(rng.integers(0, 9))
    root = rng.normal(size=(n, n))
    P = 0.1 * root @ root.T + 0.01 * np.eye(n)
    A = rng.normal(size=(k, n)) * 10.0 ** rng.uniform(0.0, 2.0)
    if k and rng.random() < 0.5:
        P = P + scale * A[:1].T @ A[:1]
    width = np.abs(rng.normal(size=(2, k)))
    width[rng.random((2, k)) < 0.2] = np.inf
    centre = rng.normal(size=k) * rng.choice([0.0, 1.0])
    return QuadraticProgram(
        P=P,
        c=rng.normal(size=n) * 10.0 ** rng.uniform(-3.0, 0.0),
        A=A,
        lower=np.concatenate([np.full(n, -0.1), centre - width[0]]),
        upper=np.concatenate([np.full(n, 0.1), centre + width[1]]),
    )


def cost(problem: QuadraticProgram, x: np.ndarray) -> float:
    return float(0.5 * x @ problem.P @ x + problem.c @ x)


def solve_with_clarabel(problem: QuadraticProgram) -> np.ndarray | None:
    program = MathematicalProgram()
    x = program.NewContinuousVariables(len(problem.c))
    program.AddQuadraticCost(problem.P, problem.c, x, is_convex=True)
    rows = np.vstack([np.eye(len(x)), problem.A])
    program.AddLinearConstraint(rows, problem.lower, problem.upper, x)
    result = ClarabelSolver().Solve(program)
    return result.GetSolution(x) if result.is_success() else None


def test_solutions_agree_with_another_solver() -> None:
    solved = 0
    for seed in range(300):
        problem = random_problem(np.random.default_rng([7, seed]))
        mine, other = solve(problem), solve_with_clarabel(problem)
        if mine is None or other is None:
            # Only problems within the other solver's tolerance of infeasible may be judged apart.
            assert mine is other or violation(problem, mine if other is None else other) < 1e-5
            continue
        solved += 1
        np.testing.assert_allclose(mine, other, atol=2e-4)
        assert violation(problem, mine) < 1e-9
        assert cost(problem, mine) <= cost(problem, other) + 1e-6
    assert solved > 200


@settings(max_examples=200)
@example(2097151)  # Contradicting limits with huge multipliers: once taken for a solution.
@given(st.integers(0, 2**32 - 1))
def test_solutions_satisfy_the_optimality_conditions_and_there_is_one_if_there_can_be(
    seed: int,
) -> None:
    problem = random_problem(np.random.default_rng(seed))
    x = solve(problem)
    if x is None:
        assert largest_margin(problem) < 1e-7
    else:
        assert violation(problem, x) < 1e-9
        assert kkt_residual(problem, x) < 1e-6


def test_a_program_without_a_minimum_is_an_error_and_a_row_of_zeros_may_rule_all_out() -> None:
    problem = random_problem(np.random.default_rng(0))
    with pytest.raises(np.linalg.LinAlgError):
        solve(problem._replace(P=np.diag(np.append(-1.0, np.ones(len(problem.c) - 1)))))
    n = len(problem.c)
    lower, upper = np.append(-np.ones(n), 1.0), np.append(np.ones(n), 2.0)
    assert solve(problem._replace(A=np.zeros((1, n)), lower=lower, upper=upper)) is None
