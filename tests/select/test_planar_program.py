import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from support.kinematics import only
from support.select_surfaces import Bumps, random_model
from support.starts import APERTURES, ARM, LINE

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.select.objective import Objective, SuccessModel
from lic_drake.select.planar_program import PlanarProgram

GOAL = np.array([0.6, 0.1, 0.0])
(REGION,) = LINE.regions


@pytest.mark.parametrize("seed", range(5))
def test_costs_and_constraints_have_the_gradients_of_finite_differences(seed: int) -> None:
    program = PlanarProgram(ARM.kinematics)
    rng = np.random.default_rng(seed)
    # A solve sets the objective.
    program.solve(
        Objective(model=random_model(seed), p_WG=GOAL),
        REGION,
        LINE.grid.x0[0],
        np.zeros(2),
        only(ARM.solve_ik(LINE.grid.x0[0])),
    )
    x = np.concatenate(
        [
            rng.uniform(REGION.lower, REGION.upper),
            rng.uniform(-0.3, 0.3, 2),
            rng.uniform(ARM.q_min, ARM.q_max),
        ]
    )
    bindings = [
        *program.program.GetAllCosts(),
        *program.program.generic_constraints(),
    ]
    assert len(bindings) == 2
    for binding in bindings:
        rows = program.program.FindDecisionVariableIndices(binding.variables())
        z = x[rows]
        by_autodiff = np.array(
            [
                value.derivatives() if isinstance(value, AutoDiffXd) else np.zeros(len(z))
                for value in np.ravel(binding.evaluator().Eval(InitializeAutoDiff(z).ravel()))
            ]
        )
        step = 1e-6
        by_differences = np.array(
            [
                (binding.evaluator().Eval(z + step * e) - binding.evaluator().Eval(z - step * e))
                / (2 * step)
                for e in np.eye(len(z))
            ]
        ).T
        np.testing.assert_allclose(by_autodiff, by_differences, atol=1e-7)
        # All five of x0 and b0 matter.
        assert np.all(np.abs(by_autodiff[:, 1:3]).max(axis=0) > 1e-6)
        assert np.all(np.abs(by_autodiff[:, 3:5]).max(axis=0) > 1e-6)


def test_joint_limits_bound_the_solution_although_the_surface_pulls_beyond_them() -> None:
    surface = Bumps(np.array([[0.3, -1.0]]), np.array([0.9]), np.array([0.3, 1.0]))
    model = SuccessModel(estimator=surface, features=PLANAR_LIC1)
    guess = np.array([REGION.lower[0], 0.3, np.deg2rad(75.0)])
    q = only(ARM.solve_ik(guess))
    assert q is not None
    x0, p_WR = PlanarProgram(ARM.kinematics).solve(
        Objective(model=model, p_WG=GOAL), REGION, guess, np.zeros(2), q
    )
    found = only(ARM.solve_ik(x0 + np.array([0.0, 0.0, 1e-4])))
    assert found is not None
    assert x0[2] < guess[2]
    np.testing.assert_array_equal(p_WR, np.zeros(2))


def test_a_mobile_base_moves_and_the_hand_stays_in_the_aperture() -> None:
    # The hand wants to be at (-0.23, 0.5) relative to the base.
    surface = Bumps(np.array([[-0.23, 0.5]]), np.array([0.9]), np.array([0.3, 0.8]))
    model = SuccessModel(estimator=surface, features=PLANAR_LIC1)
    region = APERTURES.regions[1]
    at = np.all(np.abs(APERTURES.grid.x0[:, :2] - region.lower[:2]) < 1e-9, axis=1)
    guess = APERTURES.grid.take(at).take(np.array([4]))
    x0, p_WR = PlanarProgram(ARM.kinematics).solve(
        Objective(model=model, p_WG=GOAL),
        region,
        guess.x0[0],
        guess.p_WR[0],
        only(ARM.solve_ik(guess.in_R[0])),
    )
    np.testing.assert_allclose(x0[:2], region.lower[:2], atol=1e-9)
    np.testing.assert_allclose([x0[1] - p_WR[1], x0[2]], [-0.23, 0.5], atol=2e-3)
    assert abs(p_WR[1] - guess.p_WR[0, 1]) > 0.01
