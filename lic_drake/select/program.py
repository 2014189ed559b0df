"""The constrained optimisation of Eq. (4) as a Drake MathematicalProgram."""

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, NloptSolver, SolverOptions

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import FeatureMap
from lic_drake.robots.planar_kinematics import PlanarArmKinematics

Vector = NDArray[np.float64]


class StartProgram:
    """Maximise F(s, x0) over the start pose x0 and the arm's joint angles q.

    Decision variables are x0 = (x, y, phi) and q; constraints are the joint limits, the bounds of
    the start line, which lies in the open space, and that the hand of q is at x0:

        max F(s, x0)  subject to  q_min <= q <= q_max,  FK(q) = x0,  x0 on the start line.

    One program is built for an arm and re-used: a solve sets the goal and the bounds.
    """

    def __init__(
        self, kinematics: PlanarArmKinematics, estimator: SuccessEstimator, features: FeatureMap
    ) -> None:
        self._kinematics = kinematics
        self._estimator = estimator
        self._features = features
        self._p_WG = np.zeros(3)
        self.program = MathematicalProgram()
        self.x0 = self.program.NewContinuousVariables(3, "x0")
        self.q = self.program.NewContinuousVariables(len(kinematics.q_min), "q")
        self.program.AddBoundingBoxConstraint(kinematics.q_min, kinematics.q_max, self.q)
        self._line = self.program.AddBoundingBoxConstraint(np.zeros(3), np.zeros(3), self.x0)
        self.program.AddConstraint(
            self._hand_error, np.zeros(3), np.zeros(3), np.concatenate([self.x0, self.q])
        )
        self.program.AddCost(self._cost, self.x0)
        self._options = SolverOptions()
        # Kinks of the L1 kernel can make the solver crawl; the result is checked anyway.
        self._options.SetOption(NloptSolver.id(), NloptSolver.MaxEvalName(), 60)
        self._options.SetOption(NloptSolver.id(), NloptSolver.XRelativeToleranceName(), 1e-6)
        self._solver = NloptSolver()

    def solve(
        self, p_WG: Vector, lower: Vector, upper: Vector, x0_guess: Vector, q_guess: Vector
    ) -> Vector:
        """Returns the pose that the solver ends at, shape (3,), feasible or not.

        Args:
            p_WG: Goal, shape (3,), metres.
            lower: Lower bounds of x0, shape (3,).
            upper: Upper bounds of x0, shape (3,).
            x0_guess: Where to begin, shape (3,).
            q_guess: Joint angles there, shape (m,), radians.
        """
        self._p_WG = p_WG
        self._line.evaluator().set_bounds(lower, upper)
        guess = np.concatenate([x0_guess, q_guess])
        result = self._solver.Solve(self.program, guess, self._options)
        return np.asarray(result.GetSolution(self.x0))

    def _cost(self, x0: NDArray[np.generic]) -> object:
        """Evaluates -F for numbers and for AutoDiffXd."""
        value_x0 = _values(x0)
        z = self._features.join(self._p_WG, value_x0)
        value, by_z = self._estimator.value_and_gradient(z)
        if x0.dtype != object:
            return -value
        by_x0 = self._features.gradient_by_x0(by_z)
        return AutoDiffXd(-value, -by_x0 @ ExtractGradient(x0))

    def _hand_error(self, x0_q: NDArray[np.generic]) -> object:
        """Evaluates FK(q) - x0 for numbers and for AutoDiffXd."""
        values = _values(x0_q)
        x0, q = values[:3], values[3:]
        error = self._kinematics.tip_pose(q) - x0
        if x0_q.dtype != object:
            return error
        jacobian = np.hstack([-np.eye(3), self._kinematics.tip_pose_jacobian(q)])
        return InitializeAutoDiff(error, jacobian @ ExtractGradient(x0_q))


def _values(x: NDArray[np.generic]) -> Vector:
    """Returns the numbers of an array of numbers or of AutoDiffXd."""
    return ExtractValue(x).ravel() if x.dtype == object else np.asarray(x, dtype=float)
