"""The constrained optimisation of Eqs. (3) and (4) for a planar arm, a MathematicalProgram."""

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import MathematicalProgram, NloptSolver, SolverOptions

from lic_drake.reach.starts import Region
from lic_drake.robots.kinematics import Kinematics
from lic_drake.select.objective import SuccessObjective
from lic_drake.types import Vector
from lic_drake.weak_method import weakly


class PlanarProgram:
    """Maximise F(T_b0(s), x0) over the start pose x0, the base b0 and the arm's joint angles q.

    Decision variables are x0 = (x, y, phi) and b0 = (x, y), both in W, and q; constraints are the
    joint limits, the bounds of a region, whose hand poses lie in the open space, and that the hand
    of q, on a base at b0, is at x0:

        max F(T_b0(s), x0)  subject to  q_min <= q <= q_max,  b0 + FK(q) = x0,  (x0, b0) in region.

    One program is built for an arm and re-used: a solve sets the objective and the bounds. A fixed
    base is a region without extent in b0, and the centre of an aperture one without extent in the
    position of x0.
    """

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics = kinematics
        self._objective: SuccessObjective | None = None
        self.program = MathematicalProgram()
        self.x0 = self.program.NewContinuousVariables(3, "x0")
        self.b0 = self.program.NewContinuousVariables(2, "b0")
        self.q = self.program.NewContinuousVariables(len(kinematics.q_min), "q")
        self.program.AddBoundingBoxConstraint(kinematics.q_min, kinematics.q_max, self.q)
        self._region = self.program.AddBoundingBoxConstraint(
            np.zeros(5), np.zeros(5), np.concatenate([self.x0, self.b0])
        )
        self.program.AddConstraint(
            weakly(self._hand_error), np.zeros(3), np.zeros(3), self.program.decision_variables()
        )
        self.program.AddCost(weakly(self._cost), np.concatenate([self.x0, self.b0]))
        self._options = SolverOptions()
        # Kinks of the L1 kernel can make the solver crawl; the result is checked anyway.
        self._options.SetOption(NloptSolver.id(), NloptSolver.MaxEvalName(), 60)
        self._options.SetOption(NloptSolver.id(), NloptSolver.XRelativeToleranceName(), 1e-6)
        self._solver = NloptSolver()

    def solve(
        self, objective: SuccessObjective, region: Region, x0: Vector, p_WR: Vector, q: Vector
    ) -> tuple[Vector, Vector]:
        """Returns x0, shape (3,), and b0, shape (2,), where the solver ends, feasible or not.

        Args:
            objective: What to maximise.
            region: Bounds of x0 and b0.
            x0: Start pose to begin with, shape (3,).
            p_WR: Base to begin with, shape (2,), metres.
            q: Joint angles there, shape (m,), radians.
        """
        self._objective = objective
        self._region.evaluator().set_bounds(
            np.append(region.lower, region.base_lower), np.append(region.upper, region.base_upper)
        )
        result = self._solver.Solve(self.program, np.concatenate([x0, p_WR, q]), self._options)
        return np.asarray(result.GetSolution(self.x0)), np.asarray(result.GetSolution(self.b0))

    def _cost(self, x0_b0: NDArray[np.generic]) -> object:
        """Evaluates -F for numbers and for AutoDiffXd."""
        assert self._objective is not None
        values = _values(x0_b0)
        value, by_x0, by_b0 = self._objective.value_and_gradient(
            values[:3], np.append(values[3:], 0.0)
        )
        if x0_b0.dtype != object:
            return -value
        return AutoDiffXd(-value, -np.append(by_x0, by_b0[:2]) @ ExtractGradient(x0_b0))

    def _hand_error(self, x0_b0_q: NDArray[np.generic]) -> object:
        """Evaluates b0 + FK(q) - x0 for numbers and for AutoDiffXd."""
        values = _values(x0_b0_q)
        x0, b0, q = values[:3], values[3:5], values[5:]
        error = self._kinematics.tip_pose(q) + np.append(b0, 0.0) - x0
        if x0_b0_q.dtype != object:
            return error
        pose = self._kinematics.calc_pose(q)
        J = np.vstack([pose.Jv_E[:2], pose.Jw_E[2]])
        jacobian = np.hstack([-np.eye(3), np.eye(3, 2), J])
        return InitializeAutoDiff(error, jacobian @ ExtractGradient(x0_b0_q))


def _values(x: NDArray[np.generic]) -> Vector:
    """Returns the numbers of an array of numbers or of AutoDiffXd."""
    return ExtractValue(x).ravel() if x.dtype == object else np.asarray(x, dtype=float)
