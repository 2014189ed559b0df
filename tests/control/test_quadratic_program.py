import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram, SnoptSolver, SolverInterface
from support.optimality import kkt_residual, largest_margin, violation

from lic_drake.control.quadratic_program import QuadraticProgram, solve


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
        row_min=centre - width[0],
        row_max=centre + width[1],
        x_min=np.full(n, -0.1),
        x_max=np.full(n, 0.1),
    )


def cost(problem: QuadraticProgram, x: np.ndarray) -> float:
    return float(0.5 * x @ problem.P @ x + problem.c @ x)


def solve_with(solver: SolverInterface, problem: QuadraticProgram) -> np.ndarray | None:
    program = MathematicalProgram()
    x = program.NewContinuousVariables(len(problem.c))
    program.AddQuadraticCost(problem.P, problem.c, x, is_convex=True)
    program.AddBoundingBoxConstraint(problem.x_min, problem.x_max, x)
    if len(problem.A):
        program.AddLinearConstraint(problem.A, problem.row_min, problem.row_max, x)
    result = solver.Solve(program)
    return result.GetSolution(x) if result.is_success() else None


@pytest.mark.parametrize(
    ("solver", "accuracy"),
    [(SnoptSolver(), 2e-3), (ClarabelSolver(), 2e-4)],
    ids=["snopt", "clarabel"],
)
def test_solutions_agree_with_another_solver(solver: SolverInterface, accuracy: float) -> None:
    solved = 0
    for seed in range(300):
        problem = random_problem(np.random.default_rng([7, seed]))
        mine, other = solve(problem), solve_with(solver, problem)
        if mine is None or other is None:
            # Only problems within the other solver's tolerance of infeasible may be judged apart.
            assert mine is other or violation(problem, mine if other is None else other) < 1e-5
            continue
        solved += 1
        np.testing.assert_allclose(mine, other, atol=accuracy)
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


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 5.0))
def test_force_terms_a_hundred_thousand_times_stiffer_do_not_spoil_the_solution(
    seed: int, digits: float
) -> None:
    problem = random_problem(np.random.default_rng(seed), scale=10.0**digits)
    x = solve(problem)
    if x is not None:
        # Of rows that are up to 1e5 times as large as in the test before.
        assert violation(problem, x) < 1e-9 * 10.0**digits
        assert kkt_residual(problem, x) < 1e-5


@given(st.integers(0, 2**32 - 1))
def test_the_free_optimum_is_returned_where_no_limit_binds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    P, c = root @ root.T + 0.1 * np.eye(3), rng.normal(size=3)
    free = np.linalg.solve(P, -c)
    problem = QuadraticProgram(
        P=P,
        c=c,
        A=np.zeros((0, 3)),
        row_min=np.zeros(0),
        row_max=np.zeros(0),
        x_min=np.full(3, -np.inf),
        x_max=free + 1.0,
    )
    x = solve(problem)
    assert x is not None
    np.testing.assert_allclose(x, free, atol=1e-9)


def test_a_separable_program_has_its_clipped_optimum() -> None:
    problem = QuadraticProgram(
        P=np.diag([1.0, 4.0, 2.0]),
        c=np.array([-1.0, 4.0, -10.0]),
        A=np.zeros((0, 3)),
        row_min=np.zeros(0),
        row_max=np.zeros(0),
        x_min=np.array([-np.inf, -0.5, 0.0]),
        x_max=np.array([np.inf, np.inf, 2.0]),
    )
    x = solve(problem)
    assert x is not None
    np.testing.assert_allclose(x, [1.0, -0.5, 2.0], atol=1e-12)


def test_an_equality_row_is_met_exactly() -> None:
    # Nearest point to the origin on x + 2 y = 5.
    problem = QuadraticProgram(
        P=np.eye(2),
        c=np.zeros(2),
        A=np.array([[1.0, 2.0]]),
        row_min=np.array([5.0]),
        row_max=np.array([5.0]),
        x_min=np.full(2, -10.0),
        x_max=np.full(2, 10.0),
    )
    x = solve(problem)
    assert x is not None
    np.testing.assert_allclose(x, [1.0, 2.0], atol=1e-9)


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 10.0))
def test_limits_that_contradict_each_other_give_none(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    row = rng.normal(size=3)
    row *= rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(0.0, 2.0) / np.linalg.norm(row)
    # The largest value of the row inside the box, and a limit beyond it.
    largest = 0.1 * np.abs(row).sum()
    problem = QuadraticProgram(
        P=np.eye(3),
        c=rng.normal(size=3),
        A=row[None],
        row_min=np.array([largest + gap * np.linalg.norm(row)]),
        row_max=np.array([np.inf]),
        x_min=np.full(3, -0.1),
        x_max=np.full(3, 0.1),
    )
    assert solve(problem) is None


@pytest.mark.parametrize("wanted", [0.0, 1.0])
def test_a_row_of_zeros_counts_only_if_its_limits_exclude_zero(wanted: float) -> None:
    problem = QuadraticProgram(
        P=np.eye(2),
        c=np.array([-1.0, 0.0]),
        A=np.zeros((1, 2)),
        row_min=np.array([wanted]),
        row_max=np.array([2.0]),
        x_min=np.full(2, -10.0),
        x_max=np.full(2, 10.0),
    )
    x = solve(problem)
    if wanted > 0.0:
        assert x is None
    else:
        assert x is not None
        np.testing.assert_allclose(x, [1.0, 0.0], atol=1e-12)


def test_a_cost_that_is_not_convex_is_refused() -> None:
    problem = QuadraticProgram(
        P=np.diag([1.0, -1.0]),
        c=np.zeros(2),
        A=np.zeros((0, 2)),
        row_min=np.zeros(0),
        row_max=np.zeros(0),
        x_min=np.full(2, -1.0),
        x_max=np.full(2, 1.0),
    )
    with pytest.raises(np.linalg.LinAlgError):
        solve(problem)
