"""`LicProgram`: the optimisation of paper Eqs. (3) and (4), an ordinary MathematicalProgram."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any
from weakref import WeakMethod

import numpy as np
from numpy.typing import NDArray
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue
from pydrake.multibody.inverse_kinematics import (
    AngleBetweenVectorsConstraint,
    MinimumDistanceLowerBoundConstraint,
    PositionConstraint,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.solvers import (
    MathematicalProgram,
    NloptSolver,
    SnoptSolver,
    SolverInterface,
    SolverOptions,
)
from pydrake.systems.framework import Context

from lic_drake.errors import RequestError
from lic_drake.reach.start import IN_PLANE, Start, Starts
from lic_drake.robots.arm import Arm
from lic_drake.select.objective import SuccessObjective
from lic_drake.select.situation import Situation
from lic_drake.starts import Region
from lic_drake.types import BoolVector, Vector

CLEARANCE_M = 0.001
"""The arm keeps this far from board and body, metres."""
# Pairs further apart than this do not count, metres.
_INFLUENCE_M = 0.02
# Joint angles keep this far from their limits, so that what is rounded is still within them.
_LIMIT_MARGIN_RAD = 1e-6
# By how much a start may miss a constraint that somebody added, in the constraint's unit.
_TOLERANCE = 1e-6
_UP = np.array([0.0, 0.0, 1.0])


# Kinks of an L1 kernel make solvers crawl or report failure at good points; the result is checked
# anyway. With distances SNOPT gained most (NLopt's SLSQP two thirds of it).
_NLOPT: dict[str, float] = {
    NloptSolver.MaxEvalName(): 60,
    NloptSolver.XRelativeToleranceName(): 1e-6,
    NloptSolver.ConstraintToleranceName(): 1e-9,
}
_SNOPT: dict[str, float] = {"Major iterations limit": 50}


def weakly[**P, R](method: Callable[P, R]) -> Callable[P, R]:
    """Wraps a bound method so that the wrapper holds only a weak reference to its object.

    Callbacks that Drake 1.58 holds in C++ are invisible to Python's garbage collector: an object
    whose own method is among them would never be freed, nor would the diagrams it refers to.
    """
    weak = WeakMethod(method)

    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        bound = weak()
        assert bound is not None
        return bound(*args, **kwargs)

    return call


class LicProgram(MathematicalProgram):
    """Maximise F(T_b0(s), x0) over base, torso and arm; x0 = X_WE(b0, q) is the hand's pose.

        max F(T_b0(s), X_WE(b0, q))  subject to  q_min <= q <= q_max,  b0 in its box,
        p_WE in its box,  the hand's direction in a cone,  distance(arm, board or body) >= 1 mm.

    The box and the cone are those of a `Region`, such as a start line or an aperture. One program
    serves all regions of an environment: `solve` sets their bounds. It is an ordinary
    MathematicalProgram: add constraints and costs on `b0` and `q` to it, before a
    `LicSelector` solves it. Its variables are the positions of the mobile robot in its plant.

    Attributes:
        b0: Variables of base and torso, (x, y, torso), shape (3,), metres.
        q: Variables of the joint angles, shape (m,), radians.
        situation: Goal, feasible starts and failed attempts.
        objective: F.
    """

    def __init__(self, situation: Situation, objective: SuccessObjective) -> None:
        super().__init__()
        self.situation, self.objective = situation, objective
        starts = situation.starts
        self._arm = arm = starts.arm
        # The mobile robot, before what it must keep away from if there is anything.
        known = starts.checker
        plant, context = (known.plant, known.plant_context) if known else _alone(arm)
        self.b0 = self.NewContinuousVariables(3, "b0")
        self.q = self.NewContinuousVariables(len(arm.q_min), "q")
        everything = np.concatenate([self.b0, self.q])
        world, hand = plant.world_frame(), plant.GetFrameByName(arm.tip_frame)
        zeros = np.zeros(3)

        low, high = arm.q_min + _LIMIT_MARGIN_RAD, arm.q_max - _LIMIT_MARGIN_RAD
        self.AddBoundingBoxConstraint(low, high, self.q)
        self._base = self.AddBoundingBoxConstraint(zeros, zeros, self.b0).evaluator()
        self._place = PositionConstraint(plant, world, zeros, zeros, hand, zeros, context)
        self.AddConstraint(self._place, everything)
        if not starts.regions:
            raise RequestError("there is nowhere to start from; no aperture is open")
        # All regions have the same cone. Where it is only an axis, a point 1 m ahead of the hand
        # keeps to it: the gradient of the angle would vanish there.
        (middle, angle), ahead = starts.regions[0].cone, np.array([1.0, 0.0, 0.0])
        self._axis: PositionConstraint | None = None
        if angle > 0.0:
            ends = (0.0, angle)
            cone = AngleBetweenVectorsConstraint(plant, world, middle, hand, ahead, *ends, context)
            self.AddConstraint(cone, everything)
        else:
            self._axis = PositionConstraint(plant, world, zeros, zeros, hand, ahead, context)
            self.AddConstraint(self._axis, everything)
        self._solver: SolverInterface = NloptSolver() if starts.checker is None else SnoptSolver()
        self._options, options = SolverOptions(), _SNOPT
        if starts.checker is None:
            options = _NLOPT
        else:
            clearance = MinimumDistanceLowerBoundConstraint(
                plant, CLEARANCE_M, context, influence_distance_offset=_INFLUENCE_M
            )
            self.AddConstraint(clearance, everything)
        for name, value in options.items():
            self._options.SetOption(self._solver.id(), name, value)
        self._chance = 1.0
        self.AddCost(weakly(self._cost), everything)
        bindings: list[Any] = [*self.GetAllConstraints(), *self.GetAllCosts()]
        self._own = [binding.evaluator() for binding in bindings]
        self.set_region(starts.regions[0])

    def set_region(self, region: Region) -> None:
        """Makes a region the one whose bounds of x0 and b0 hold, at first that of `regions[0]`."""
        low, high = region.position
        self._base.set_bounds(region.b0_lower, region.b0_upper)
        self._place.set_bounds(low, high)
        if self._axis is not None:
            direction, _ = region.cone
            free = np.where(direction == 0.0, 0.0, np.inf)
            self._axis.set_bounds(low + direction - free, high + direction + free)
        self._chance = float(self.situation.starts.chance(region.lower[None])[0])

    def solve(self, region: Region, start: Start) -> Start:
        """Returns where the solver ends in a region, feasible or not, from joint angles on."""
        assert start.q is not None
        self.set_region(region)
        result = self._solver.Solve(self, np.append(start.b0, start.q), self._options)
        b0, q = result.GetSolution(self.b0), result.GetSolution(self.q)
        if not np.all(np.isfinite([*b0, *q])):  # There is nothing feasible.
            return start
        return Start(self.hand_pose(b0, q), b0, q)

    def hand_pose(self, b0: Vector, q: Vector) -> Vector:
        """Returns x0 = X_WE(b0, q), shape (3,), or (7,) in space."""
        x0 = self._arm.tip_pose(q)
        axes = 2 if len(x0) == IN_PLANE else 3
        x0[:axes] += b0[:axes]
        return x0

    def estimates(self, starts: Starts) -> Vector:
        """Returns F at n starts, shape (n,), times the chance that they are as they seem."""
        return self.objective.values(starts) * self.situation.starts.chance(starts.x0)

    def values(self, starts: Starts) -> Vector:
        """Returns what is maximised at n starts, shape (n,): F less the costs that were added.

        Those on joint angles do not count for starts without them.
        """
        values = self.estimates(starts)
        for binding in self._added(self.GetAllCosts()):
            known, value = self._evaluate(binding, starts)
            values[known] -= value[:, 0]
        return values

    def satisfied(self, starts: Starts) -> BoolVector:
        """Returns which of n starts satisfy the constraints that were added; see `values`."""
        satisfied = np.ones(len(starts), dtype=bool)
        for binding in self._added(self.GetAllConstraints()):
            known, value = self._evaluate(binding, starts)
            low, high = binding.evaluator().lower_bound(), binding.evaluator().upper_bound()
            beyond = np.maximum(low - value, value - high)
            satisfied[known] &= np.all(beyond <= _TOLERANCE, axis=1)
        return satisfied

    def _added(self, bindings: Sequence[Any]) -> list[Any]:
        """Returns those costs or constraints that were added by others."""
        return [b for b in bindings if not any(b.evaluator() is own for own in self._own)]

    def _evaluate(self, binding: Any, starts: Starts) -> tuple[BoolVector, Vector]:
        """Returns for which of n starts a binding's variables are known, and its values there."""
        index = self.FindDecisionVariableIndices(binding.variables())
        q = np.full((len(starts), len(self.q)), np.nan) if starts.q is None else starts.q
        if max(index, default=-1) >= 3 + q.shape[1]:
            raise RequestError(
                f"{binding} has variables other than b0 and q, so that it cannot be evaluated for"
                " the candidates of a selection; express it by program.b0 and program.q"
            )
        rows = np.hstack([starts.b0, q])[:, index]
        known = np.all(np.isfinite(rows), axis=1)
        evaluator = binding.evaluator()
        value = [evaluator.Eval(row) for row in rows[known]]
        return known, np.array(value).reshape(-1, evaluator.num_outputs())

    def _cost(self, b0_q: NDArray[np.generic]) -> object:
        """Evaluates -F for numbers and for AutoDiffXd."""
        is_plain = b0_q.dtype != object
        values = np.asarray(b0_q, dtype=float) if is_plain else ExtractValue(b0_q).ravel()
        b0, q = values[:3], values[3:]
        x0 = self.hand_pose(b0, q)
        value, by_x0, by_b0 = self.objective.value_and_gradient(x0, b0)
        if is_plain:
            return -self._chance * value
        pose = self._arm.calc_pose(q)
        by_hand = np.append(by_x0[:2], 0.0) if len(x0) == IN_PLANE else by_x0[:3]
        turn = by_x0[2] * _UP if len(x0) == IN_PLANE else by_x0[3:] @ _quaternion_rates(x0[3:])
        by_q = by_hand @ pose.Jv_E + turn @ pose.Jw_E
        gradient = np.concatenate([by_b0 + by_hand, by_q]) @ ExtractGradient(b0_q)
        return AutoDiffXd(-self._chance * value, -self._chance * gradient)


@lru_cache(maxsize=16)
def _alone(arm: Arm) -> tuple[MultibodyPlant, Context]:
    plant = MultibodyPlant(time_step=0.0)
    arm.add_to_plant(plant, mobile=True)
    plant.Finalize()
    return plant, plant.CreateDefaultContext()


def _quaternion_rates(wxyz: Vector) -> Vector:
    """Returns the matrix, shape (4, 3), that takes angular velocity in W to a quaternion's rate."""
    w, x, y, z = wxyz
    return 0.5 * np.array([[-x, -y, -z], [w, z, -y], [-z, w, x], [y, -x, w]])
