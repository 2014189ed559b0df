"""LIC's optimisation for a PR2 before a board of apertures."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lic_drake.errors import RequestError
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.start import Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessObjective
from lic_drake.select.pointing_places import LATTICE_M, find_neighbours, make_lattice
from lic_drake.select.pointing_program import PointingProgram
from lic_drake.select.situation import Situation
from lic_drake.types import Vector

FINE_M = 0.003
"""Around the best places of a lattice the distance of places is halved until it is at most this."""

RISE_PER_M = 5.0
"""Beside a place an estimate may be higher than there by this times the distance: the second stage
of LIC-2 has crests where the first one's estimate has a certain value, and an L1 kernel has kinks,
where a solver stops. From the best place of each aperture alone its end was below the best of
20,000 samples in every fifth situation, by up to 17 points."""

MAX_REFINED = 150
"""Only around so many places, the best ones of all apertures, others are looked at."""

MAX_TRIED = 40
"""So many places at an aperture are tried, the best first, until the arm can be there."""

RETRY_M = 0.1
"""How far base and torso are at least from where they failed at the same aperture: a step of the
grid, as in the plane; the "local neighborhood" of paper VI-A."""

SAME_M = 0.05
"""Apertures nearer to each other than this are the same one, seen twice."""

MAX_GAIN = 0.02
"""Apertures whose best place of the lattice is estimated this much below the best are left out."""


class PointingLic(LicSelector):
    """Optimises with a MathematicalProgram, at each aperture from its best place.

    A further attempt with LIC-2 goes through another aperture, or stands elsewhere: base and torso
    at least `RETRY_M` from where they were.
    """

    def _candidates(self, situation: Situation) -> Starts:
        grid = _pointing(situation).grid
        return grid.take(is_apart(situation, grid))

    def _chance(self, situation: Situation, conditions: Starts) -> Vector:
        return _pointing(situation).chance(conditions.x0)

    def _improve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        candidates: Starts,
        values: Vector,
    ) -> Iterator[Starts]:
        starts = _pointing(situation)
        places, found = self._search(situation, objective, candidates, values)
        best = float(values.max())
        apertures = [np.all(np.isclose(places.x0[:, :3], p_WA), axis=1) for p_WA in starts.p_WA]
        for here in sorted(apertures, key=lambda here: -found.max(where=here, initial=-np.inf)):
            if found.max(where=here, initial=-np.inf) < best - MAX_GAIN:
                break
            start = _first_possible(starts, places.take(here), found[here])
            if start is None:
                continue
            for pose, b0 in (start, self._solve(starts, objective, *start)):
                condition = Starts(pose[None], b0[None])
                possible = starts.angles(pose, b0[:2], b0[2]) is not None
                if possible and is_apart(situation, condition)[0]:
                    yield condition
                    value = objective.values(condition) * self._chance(situation, condition)
                    best = max(best, float(value[0]))

    def _search(
        self,
        situation: Situation,
        objective: SuccessObjective,
        candidates: Starts,
        values: Vector,
    ) -> tuple[Starts, Vector]:
        """Returns places at all apertures, denser where estimates are high, and the estimates.

        An aperture has the tool pose of its best candidate.
        """
        starts = _pointing(situation)
        places = candidates.take(np.zeros(0, dtype=int))
        for p_WA in starts.p_WA:
            here = np.all(np.isclose(candidates.x0[:, :3], p_WA), axis=1)
            if np.any(here):
                x0 = candidates.x0[np.flatnonzero(here)[np.argmax(values[here])]]
                places = places.join(make_lattice(starts, x0))
        found = self._values(situation, objective, places)
        step_m = LATTICE_M
        while step_m > FINE_M:
            high = np.argsort(-found, kind="stable")[:MAX_REFINED]
            high = high[found[high] > found.max() - RISE_PER_M * step_m]
            step_m /= 2.0
            nearby = find_neighbours(starts.stand, places.take(high), step_m)
            places = places.join(nearby)
            found = np.append(found, self._values(situation, objective, nearby))
        return places, found

    def _values(self, situation: Situation, objective: SuccessObjective, places: Starts) -> Vector:
        """Returns the estimates of n places, -inf for those that are not allowed, shape (n,)."""
        values = objective.values(places) * self._chance(situation, places)
        return np.where(is_apart(situation, places), values, -np.inf)

    def _solve(
        self, starts: PointingStarts, objective: SuccessObjective, x0: Vector, b0: Vector
    ) -> tuple[Vector, Vector]:
        """Returns x0 and b0 where the optimisation ends, possible or not."""
        q = starts.angles(x0, b0[:2], b0[2])
        assert q is not None  # The arm can be there.
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


def is_apart(situation: Situation, conditions: Starts) -> NDArray[np.bool_]:
    """Tells which of n initial conditions are not those that failed, nor near them, shape (n,)."""
    apart = np.ones(len(conditions), dtype=bool)
    for failed in (reach.start for reach in situation.failed):
        same = np.linalg.norm(conditions.x0[:, :3] - failed.x0[:3], axis=1) < SAME_M
        apart &= ~same | (np.linalg.norm(conditions.b0 - failed.b0, axis=1) >= RETRY_M)
    return apart


def _first_possible(
    starts: PointingStarts, places: Starts, values: Vector
) -> tuple[Vector, Vector] | None:
    """Returns tool pose and place, shape (7,) and (3,), of the best place where the arm can be."""
    for i in np.argsort(-values, kind="stable")[:MAX_TRIED]:
        if values[i] == -np.inf:
            break
        b0 = _inside(starts, places.b0[i])
        found = starts.pre_select(places.x0[i, :3], b0)
        if found is not None:
            return found[0], b0
    return None


def _inside(starts: PointingStarts, b0: Vector) -> Vector:
    """Returns b0 within its range, to the micrometre."""
    stand = starts.stand
    low = [0.0, stand.y_min_m, stand.torso_min_m]
    high = [0.0, stand.y_max_m, stand.torso_max_m]
    return np.clip(np.round(b0, 6), low, high) + 0.0
