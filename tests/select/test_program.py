import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from select_surfaces import Bumps, random_bumps

from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.reach.task import StartLine
from lic_drake.robots.planar import planar_arm
from lic_drake.select.program import StartProgram

ARM = planar_arm()
LINE = StartLine()


@pytest.mark.parametrize("seed", range(5))
def test_costs_and_constraints_have_the_gradients_of_finite_differences(seed: int) -> None:
    program = StartProgram(ARM.kinematics, random_bumps(seed), PLANAR_LIC1)
    rng = np.random.default_rng(seed)
    x = np.concatenate([rng.uniform(LINE.lower, LINE.upper), rng.uniform(ARM.q_min, ARM.q_max)])
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


def test_joint_limits_bound_the_solution_although_the_surface_pulls_beyond_them() -> None:
    surface = Bumps(np.array([[0.3, -1.0]]), np.array([0.9]), np.array([0.3, 1.0]))
    program = StartProgram(ARM.kinematics, surface, PLANAR_LIC1)
    guess = np.array([LINE.x_m, 0.3, np.deg2rad(75.0)])
    q = ARM.solve_ik(guess)
    assert q is not None
    x0 = program.solve(np.array([0.6, 0.1, 0.0]), LINE.lower, LINE.upper, guess, q)
    found = ARM.solve_ik(x0 + np.array([0.0, 0.0, 1e-4]))
    assert found is not None
    assert x0[2] < guess[2]
