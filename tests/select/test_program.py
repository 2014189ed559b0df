"""The optimisation with known optima, its gradients, and what a user adds to it."""

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from support.pr2_reaches import SCENARIO
from support.select_surfaces import Bumps, random_model
from support.starts import APERTURES, ARM, LINE

from lic_drake.errors import RequestError
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.reach.start import Start, Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import Objective, SuccessModel
from lic_drake.select.program import LicProgram
from lic_drake.select.situation import Situation
from lic_drake.starts import Region, board_starts, find_regions

GOAL = np.array([0.6, 0.1, 0.0])
BOARD = board_starts(SCENARIO, SCENARIO.sample_instance("holdout", 0), moves=True)
P_WG = np.array([0.84, -0.2, 0.9])
ROLLING = FeatureMap(goal=("goal_y", "goal_z"), start=("start_y", "start_z", "start_qx"))
"""Features of a hand behind a board that may roll."""


class Hill(Bumps):
    """A paraboloid over the features (goal y, z; start y, z, qx) with its top at `top`."""

    def __init__(self, top: np.ndarray, weight: np.ndarray) -> None:
        self.top, self.weight = top, weight

    def _values(self, X: np.ndarray) -> np.ndarray:
        return np.asarray(1.0 - (X - self.top) ** 2 @ self.weight)

    def value_and_gradient(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(self.values(x[None])[0]), -2.0 * self.weight * (x - self.top)


def planar(model: SuccessModel, starts: object = LINE) -> LicProgram:
    situation = Situation(p_WG=GOAL, starts=starts)  # type: ignore[arg-type]
    return LicProgram(situation, Objective(model=model, p_WG=GOAL))


def hill(top_y: float, top_z: float, qx: float | None = None) -> LicProgram:
    """Wants the start at a place relative to b0, and, if given, a roll of the tool."""
    top = np.array([0.0, 0.0, top_y, top_z, 0.0 if qx is None else qx])
    weight = np.array([0.0, 0.0, 1.0, 1.0, 0.0 if qx is None else 0.1])
    model = SuccessModel(estimator=Hill(top, weight), features=ROLLING)
    return LicProgram(Situation(p_WG=P_WG, starts=BOARD), Objective(model=model, p_WG=P_WG))


def of_grid(k: int) -> tuple[Region, Start]:
    return BOARD.regions[find_regions(BOARD.regions, BOARD.grid)[k]], BOARD.grid[k]


@pytest.mark.parametrize("case", range(6))
def test_costs_and_constraints_have_the_gradients_of_finite_differences(case: int) -> None:
    rng = np.random.default_rng(case)
    if case < 4:
        program = planar(random_model(case), (LINE, APERTURES)[case % 2])
        x = np.append(rng.uniform(-0.3, 0.3, 3), rng.uniform(ARM.q_min, ARM.q_max))
    else:
        program = hill(-0.3, 0.7, 0.2)
        start = BOARD.grid[10 + 340 * (case - 4)]
        x = np.append([0.0, 0.05, 0.1], start.q) + 0.02 * rng.normal(size=10)
    smooth = [
        *program.GetAllCosts(),
        *(b for b in program.generic_constraints() if b.evaluator().num_outputs() != 1),
    ]
    assert len(smooth) == (2 if case < 4 else 3)
    for binding in smooth:
        evaluator = binding.evaluator()
        by_autodiff = np.array(
            [
                value.derivatives() if isinstance(value, AutoDiffXd) else np.zeros(len(x))
                for value in np.ravel(evaluator.Eval(InitializeAutoDiff(x).ravel()))
            ]
        )
        by_differences = np.array(
            [(evaluator.Eval(x + e) - evaluator.Eval(x - e)) / 2e-6 for e in 1e-6 * np.eye(len(x))]
        ).T
        np.testing.assert_allclose(by_autodiff, by_differences, atol=1e-6)


@pytest.mark.parametrize("starts", [LINE, APERTURES, BOARD], ids=["line", "apertures", "board"])
def test_what_is_feasible_by_closed_forms_satisfies_drakes_constraints(starts: object) -> None:
    """And what is not, 1 mm or 0.1 degrees beside, violates one of them."""
    program = planar(random_model(0), starts) if starts is not BOARD else hill(0.0, 0.0)
    grid = program.situation.starts.grid
    for k in range(0, len(grid), 7 if starts is not BOARD else 150):
        start = grid[k]
        region = program.situation.starts.regions[
            find_regions(program.situation.starts.regions, grid)[k]
        ]
        program.solve(region, start)  # Sets the bounds.
        x = np.append(start.b0, start.q)
        bindings = [
            b for b in program.GetAllConstraints() if "MinimumDistance" not in str(b.evaluator())
        ]
        assert all(program.CheckSatisfied(binding, x, 1e-6) for binding in bindings)
        aside = x + np.append([0.001, 0.0, 0.0], np.zeros(len(start.q)))
        assert not all(program.CheckSatisfied(binding, aside, 1e-6) for binding in bindings)


def test_joint_limits_bound_the_solution_although_the_surface_pulls_beyond_them() -> None:
    surface = Bumps(np.array([[0.3, -1.0]]), np.array([0.9]), np.array([0.3, 1.0]))
    program = planar(SuccessModel(estimator=surface, features=PLANAR_LIC1))
    (region,) = LINE.regions
    x0 = np.array([region.lower[0], 0.3, np.deg2rad(75.0)])
    found = program.solve(region, Start(x0, np.zeros(3), LINE.solve(x0, np.zeros(3))))
    assert found.x0[2] < x0[2]
    assert len(ARM.solve_ik(found.x0 + np.array([0.0, 0.0, 1e-4])))
    np.testing.assert_array_equal(found.b0, np.zeros(3))


def test_a_mobile_base_moves_and_the_hand_stays_in_the_aperture() -> None:
    # The hand wants to be at (-0.23, 0.5) relative to the base.
    surface = Bumps(np.array([[-0.23, 0.5]]), np.array([0.9]), np.array([0.3, 0.8]))
    program = planar(SuccessModel(estimator=surface, features=PLANAR_LIC1), APERTURES)
    here = np.flatnonzero(find_regions(APERTURES.regions, APERTURES.grid) == 1)
    guess = APERTURES.grid[int(here[4])]
    found = program.solve(APERTURES.regions[1], guess)
    np.testing.assert_allclose(found.x0[:2], APERTURES.regions[1].lower[:2], atol=1e-8)
    np.testing.assert_allclose(found.x0_R[1:], [-0.23, 0.5], atol=2e-3)
    assert abs(found.b0[1] - guess.b0[1]) > 0.01


@pytest.mark.parametrize("k", [3, 431, 640])
def test_base_and_torso_bring_the_aperture_to_the_best_place(k: int) -> None:
    region, start = of_grid(k)
    best_b0 = np.clip(start.b0 + [0.0, 0.03, -0.02], region.b0_lower, region.b0_upper)
    wanted = start.x0[:3] - best_b0
    found = hill(wanted[1], wanted[2]).solve(region, start)
    np.testing.assert_allclose(found.b0, best_b0, atol=1e-3)
    np.testing.assert_allclose(found.x0[:3], start.x0[:3], atol=1e-5)
    np.testing.assert_allclose(found.x0[5:], 0.0, atol=1e-5)
    snapped = BOARD.snap(region, found)
    assert snapped is not None and snapped.q is not None
    assert np.abs(snapped.q - found.q).max() < 1e-3  # What the program found is what is executed.


def test_the_tool_rolls_where_that_is_estimated_to_help() -> None:
    region, start = of_grid(300)
    here, wanted = start.x0[:3] - start.b0, start.x0[4] - 0.1
    found = hill(here[1], here[2], wanted).solve(region, start)
    assert found.x0[4] == pytest.approx(wanted, abs=1e-3)


# What a user adds


RIGHT = SuccessModel(
    estimator=Bumps(np.array([[-0.25, 0.3]]), np.array([0.9]), np.array([0.3, 0.8])),
    features=PLANAR_LIC1,
)
"""Wants the hand 0.25 m to the right of the base, and so the base to the left of the aperture."""


def test_a_bound_of_the_base_in_the_plane_is_kept_by_the_answer() -> None:
    selector = LicSelector(RIGHT)
    situation = Situation(p_WG=np.array([0.6, 0.5, 0.0]), starts=APERTURES)
    free = selector.select(situation)
    bound = float(free.start.b0[1]) - 0.2
    program = selector.program(situation)
    program.AddLinearConstraint(program.b0[1] <= bound)
    kept = selector.solve(program)
    assert kept.start.b0[1] <= bound + 1e-6
    assert kept.probability is not None and free.probability is not None
    assert kept.probability < free.probability
    # No start of a dense set within the bound is better.
    lattice = APERTURES.lattice(np.zeros(0))
    inside = lattice.take(lattice.b0[:, 1] <= bound)
    assert kept.probability >= program.estimates(inside).max() - 1e-9


def test_bounds_of_base_and_torso_of_a_pr2_are_kept_by_the_answer() -> None:
    selector = LicSelector(
        SuccessModel(
            estimator=Hill(np.array([0.0, 0.0, -1.2, 0.4, 0.0]), np.array([0, 0, 1.0, 1.0, 0])),
            features=ROLLING,
        )
    )
    situation = Situation(p_WG=P_WG, starts=BOARD)
    free = selector.select(situation)
    assert free.start.b0[1] > 0.15 and free.start.b0[2] > 0.15
    program = selector.program(situation)
    program.AddLinearConstraint(program.b0[1] <= 0.037)
    program.AddBoundingBoxConstraint(0.05, 0.1234, program.b0[2:])
    kept = selector.solve(program)
    assert kept.start.b0[1] <= 0.037 + 1e-6
    assert 0.05 - 1e-6 <= kept.start.b0[2] <= 0.1234 + 1e-6
    assert kept.start.q is not None
    assert BOARD.solve(kept.start.x0, kept.start.b0, kept.start.q) is not None


def test_a_constraint_that_no_candidate_satisfies_is_left_to_the_solver() -> None:
    selector = LicSelector(RIGHT)
    program = selector.program(Situation(p_WG=GOAL, starts=APERTURES))
    program.AddLinearEqualityConstraint(program.b0[1] == 0.1237)
    assert selector.solve(program).start.b0[1] == pytest.approx(0.1237, abs=1e-6)


def test_a_joint_angle_may_be_bounded_and_a_base_may_cost() -> None:
    selector = LicSelector(random_model(1))
    situation = Situation(p_WG=GOAL, starts=APERTURES)
    free = selector.select(situation)
    assert free.start.q is not None
    program = selector.program(situation)
    program.AddBoundingBoxConstraint(-np.inf, float(free.start.q[1]) - 0.2, program.q[1:2])
    bent = selector.solve(program)
    assert bent.start.q is not None and bent.start.q[1] <= free.start.q[1] - 0.2 + 1e-6
    program = selector.program(situation)
    program.AddQuadraticCost(50.0 * (program.b0[1] - 0.3) ** 2)
    near = selector.solve(program)
    assert abs(near.start.b0[1] - 0.3) < 0.05 < abs(free.start.b0[1] - 0.3)
    # The estimate is the estimator's, without the cost.
    estimate = selector.objective(situation).values(Starts.of(near.start))[0]
    assert near.probability == pytest.approx(min(estimate, 1.0))


def test_what_cannot_be_satisfied_is_refused() -> None:
    selector = LicSelector(RIGHT)
    program = selector.program(Situation(p_WG=GOAL, starts=LINE))
    program.AddLinearConstraint(program.b0[1] >= 1.0)
    with pytest.raises(RequestError, match="satisfies the constraints of the program"):
        selector.solve(program)
    program = selector.program(Situation(p_WG=GOAL, starts=LINE))
    slack = program.NewContinuousVariables(1)
    program.AddLinearConstraint(program.q[0] - slack[0] <= 0.0)
    with pytest.raises(RequestError, match="has variables other than b0 and q"):
        selector.solve(program)
