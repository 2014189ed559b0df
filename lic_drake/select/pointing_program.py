"""The constrained optimisation of Eqs. (3) and (4) for a PR2 at an aperture."""

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.solvers import MathematicalProgram, SnoptSolver, SolverOptions

from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.select.objective import SuccessObjective
from lic_drake.types import Vector
from lic_drake.weak_method import weakly

CLEARANCE_M = 0.001
"""The arm keeps this far from board and body, metres."""

INFLUENCE_M = 0.02
"""Pairs further apart than this do not count, metres."""


class PointingProgram:
    """Maximise F(T_b0(s), x0) over base, torso and arm, the tool in the centre of an aperture.

    Decision variables are b0, the base's position, of which y is free, and the height of the torso,
    and the joint angles q:

        max F(T_b0(s), x0)  subject to  b0 + FK(q) = p_WA,  x of the tool = x of W,
        q_min <= q <= q_max,  y and torso in their ranges,  distance(arm, board or body) >= 1 mm.

    One program is built for an environment and re-used: a solve sets objective and aperture.
    """

    def __init__(self, starts: PointingStarts) -> None:
        stand = starts.stand
        self._arm = starts.scenario.arm()
        self._objective: SuccessObjective | None = None
        self._p_WA = np.zeros(3)
        self.program = MathematicalProgram()
        self.b0 = self.program.NewContinuousVariables(3, "b0")
        self.q = self.program.NewContinuousVariables(7, "q")
        everything = self.program.decision_variables()
        self.program.AddBoundingBoxConstraint(
            np.array([0.0, stand.y_min_m, stand.torso_min_m]),
            np.array([0.0, stand.y_max_m, stand.torso_max_m]),
            self.b0,
        )
        self.program.AddBoundingBoxConstraint(self._arm.q_min, self._arm.q_max, self.q)
        self.program.AddConstraint(weakly(self._tool_error), np.zeros(5), np.zeros(5), everything)
        self.program.AddConstraint(
            MinimumDistanceLowerBoundConstraint(
                plant=starts.checker.plant,
                bound=CLEARANCE_M,
                plant_context=starts.checker.plant_context,
                influence_distance_offset=INFLUENCE_M,
            ),
            everything,
        )
        self.program.AddCost(weakly(self._cost), everything)
        # Of Drake's solvers the one that gained most (NLopt's SLSQP two thirds of it): kinks of the
        # L1 kernel make it report failure at good points, which are checked anyway.
        self._options = SolverOptions()
        self._options.SetOption(SnoptSolver.id(), "Major iterations limit", 50)
        self._solver = SnoptSolver()

    def solve(
        self, objective: SuccessObjective, p_WA: Vector, b0: Vector, q: Vector
    ) -> tuple[Vector, Vector]:
        """Returns b0, shape (3,), and q, shape (7,), where the solver ends, feasible or not.

        Args:
            objective: What to maximise.
            p_WA: The aperture's centre, shape (3,), metres.
            b0: Place of the base and height of the torso to begin with, shape (3,), metres.
            q: Joint angles to begin with, shape (7,), radians.
        """
        self._objective, self._p_WA = objective, p_WA
        guess = np.concatenate([b0, q])
        result = self._solver.Solve(self.program, guess, self._options)
        return np.asarray(result.GetSolution(self.b0)), np.asarray(result.GetSolution(self.q))

    def _cost(self, positions: NDArray[np.generic]) -> object:
        """Evaluates -F for numbers and for AutoDiffXd."""
        assert self._objective is not None
        values = _values(positions)
        b0, q = values[:3], values[3:]
        x0 = self.tool_pose(b0, q)
        value, by_x0, by_b0 = self._objective.value_and_gradient(x0, b0)
        if positions.dtype != object:
            return -value
        pose = self._arm.calc_pose(q)
        gradient = np.zeros(10)
        gradient[:3] = by_x0[:3] + by_b0
        gradient[3:] = by_x0[:3] @ pose.Jv_E
        gradient[3:] += by_x0[3:] @ _quaternion_rates(x0[3:]) @ pose.Jw_E
        return AutoDiffXd(-value, -gradient @ ExtractGradient(positions))

    def _tool_error(self, positions: NDArray[np.generic]) -> object:
        """Evaluates how far the tool is from the centre and how much it points aside."""
        values = _values(positions)
        b0, q = values[:3], values[3:]
        pose = self._arm.calc_pose(q)
        aim = pose.R_RE[:, 0]
        error = np.concatenate([self.tool_pose(b0, q)[:3] - self._p_WA, aim[1:]])
        if positions.dtype != object:
            return error
        jacobian = np.zeros((5, 10))
        jacobian[:3, :3] = np.eye(3)
        jacobian[:3, 3:] = pose.Jv_E
        # The rate of a vector that turns with w is w x aim.
        jacobian[3:, 3:] = -_cross_matrix(aim)[1:] @ pose.Jw_E
        return InitializeAutoDiff(error, jacobian @ ExtractGradient(positions))

    def tool_pose(self, b0: Vector, q: Vector) -> Vector:
        """Returns x0 in W, shape (7,).

        Args:
            b0: Place of the base and height of the torso, shape (3,), metres.
            q: Joint angles, shape (7,), radians.
        """
        x0 = self._arm.tip_pose(q)
        x0[:3] += b0
        return x0


def _quaternion_rates(wxyz: Vector) -> Vector:
    """Returns the matrix, shape (4, 3), that takes angular velocity in W to a quaternion's rate."""
    w, x, y, z = wxyz
    return 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])


def _cross_matrix(v: Vector) -> Vector:
    """Returns the matrix, shape (3, 3), of the cross product with v from the left."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _values(x: NDArray[np.generic]) -> Vector:
    """Returns the numbers of an array of numbers or of AutoDiffXd."""
    return ExtractValue(x).ravel() if x.dtype == object else np.asarray(x, dtype=float)
