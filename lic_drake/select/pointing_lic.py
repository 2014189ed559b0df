"""LIC's optimisation for a PR2 before a board of apertures."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lic_drake.errors import RequestError
from lic_drake.reach.initial_conditions import InitialConditions
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessObjective
from lic_drake.select.pointing_program import PointingProgram
from lic_drake.select.situation import Situation

Vector = NDArray[np.float64]

MAX_GAIN = 0.15
"""Apertures whose best candidate is estimated this much below the best are not optimised."""


class PointingLic(LicSelector):
    """Optimises with a MathematicalProgram, one solve an aperture from its best candidate."""

    def _candidates(self, situation: Situation) -> InitialConditions:
        return _pointing(situation).grid

    def _chance(self, situation: Situation, conditions: InitialConditions) -> Vector:
        return _pointing(situation).chance(conditions.x0)

    def _improve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        candidates: InitialConditions,
        values: Vector,
    ) -> Iterator[InitialConditions]:
        starts = _pointing(situation)
        for p_WA in starts.p_WA:
            here = np.flatnonzero(np.all(np.isclose(candidates.x0[:, :3], p_WA), axis=1))
            if len(here) == 0:
                continue
            i = here[np.argmax(values[here])]
            if values[i] < values.max() - MAX_GAIN:
                continue
            x0, b0 = self._solve(starts, objective, candidates.x0[i], candidates.b0[i])
            if starts.angles(x0, b0[:2], b0[2]) is not None:
                yield InitialConditions(x0[None], b0[None, :2], b0[2:])

    def _solve(
        self, starts: PointingStarts, objective: SuccessObjective, x0: Vector, b0: Vector
    ) -> tuple[Vector, Vector]:
        """Returns x0 and b0 where the optimisation ends, possible or not."""
        q = starts.angles(x0, b0[:2], b0[2])
        assert q is not None  # It is one of the grid.
        program = PointingProgram(starts)
        p_WA = x0[:3]
        b0, q = program.solve(objective, p_WA, b0, q)
        w, x, _, _ = program.tool_pose(b0, q)[3:]
        return _pose(p_WA, np.arctan2(x, w)), _inside(starts, b0)


class PointingLbfgsb(PointingLic):
    """The paper's own optimiser: L-BFGS-B over base and torso, the arm pre-selected (III-E)."""

    def _solve(
        self, starts: PointingStarts, objective: SuccessObjective, x0: Vector, b0: Vector
    ) -> tuple[Vector, Vector]:
        stand = starts.stand

        def cost(y_z: Vector) -> tuple[float, Vector]:
            value, _, by_b0 = objective.value_and_gradient(x0, np.array([b0[0], *y_z]))
            return -value, -by_b0[1:]

        result = minimize(
            cost,
            b0[1:],
            jac=True,
            method="L-BFGS-B",
            bounds=[
                (stand.y_min_m, stand.y_max_m),
                (stand.torso_min_m, stand.torso_max_m),
            ],
        )
        return x0, _inside(starts, np.array([b0[0], *result.x]))


def _pointing(situation: Situation) -> PointingStarts:
    if not isinstance(situation.starts, PointingStarts):
        raise RequestError("this needs a PR2 before a board of apertures")
    return situation.starts


def _pose(p_WA: Vector, half_roll: float) -> Vector:
    """Returns the pose of a tool that points along Wx in the centre of an aperture, shape (7,)."""
    wxyz = np.array([np.cos(half_roll), np.sin(half_roll), 0.0, 0.0])
    return np.concatenate([p_WA, wxyz if wxyz[0] >= 0.0 else -wxyz]) + 0.0


def _inside(starts: PointingStarts, b0: Vector) -> Vector:
    """Returns b0 within its range, to the micrometre."""
    stand = starts.stand
    low = [0.0, stand.y_min_m, stand.torso_min_m]
    high = [0.0, stand.y_max_m, stand.torso_max_m]
    return np.clip(np.round(b0, 6), low, high) + 0.0
