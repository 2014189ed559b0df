"""LIC-1 and LIC-2: the start with the highest estimated probability of success (paper III)."""

import time
from collections import Counter
from contextlib import suppress
from itertools import product

import numpy as np

from lic_drake.errors import EstimateError, RequestError
from lic_drake.reach.start import Start, Starts
from lic_drake.select.objective import Objective, SuccessModel, SuccessObjective
from lic_drake.select.program import LicProgram
from lic_drake.select.situation import Selection, Situation
from lic_drake.starts import Region, find_regions
from lic_drake.types import Vector

# First and last step of a pattern search, as shares of the region's width.
_FIRST_STEP, _SMALLEST_STEP = 1.0 / 16.0, 1e-6
# Number of candidates of a region that are tried, best first, until one is feasible.
_MAX_TRIED = 40
# Smallest improvement that counts; less is rounding.
_LEAST_GAIN = 1e-9
# Penalty of candidates that violate a constraint.
_VIOLATED = 1e6


class _Best:
    """The best start found so far that satisfies a program and is away from failed ones."""

    def __init__(self, program: LicProgram) -> None:
        self._program = program
        self.start: Start | None = None
        self.value = -np.inf

    def consider(self, start: Start | None) -> None:
        """Takes a start if it is better."""
        if start is None:
            return
        asked, program = Starts.of(start), self._program
        value = float(program.values(asked)[0])
        if value <= self.value + _LEAST_GAIN or not program.satisfied(asked)[0]:
            return
        if program.objective.failed or program.situation.allowed(asked)[0]:
            self.start, self.value = start, value


def climb(program: LicProgram, region: Region, best: _Best) -> None:
    """Improves a start by a pattern search over hand, base and torso within a region.

    An L1 kernel and K-NN have kinks, on which a solver that follows gradients stops early.
    """
    starts = program.situation.starts
    width = np.append(region.upper[:3] - region.lower[:3], region.b0_upper - region.b0_lower)
    free = np.flatnonzero(width > _SMALLEST_STEP)
    steps = np.zeros((3 ** len(free), 6))
    steps[:, free] = width[free] * list(product((-1.0, 0.0, 1.0), repeat=len(free)))
    scale = _FIRST_STEP
    while best.start is not None and scale > _SMALLEST_STEP:
        before = best.value
        x0 = np.tile(best.start.x0, (len(steps), 1))
        x0[:, :3] += scale * steps[:, :3]
        x0 = np.clip(x0, region.lower, region.upper)
        b0 = np.round(best.start.b0 + scale * steps[:, 3:], 6)
        b0 = np.clip(b0, region.b0_lower, region.b0_upper)
        values = program.values(Starts(x0, b0))
        for k in np.argsort(-values, kind="stable"):
            if values[k] <= before + _LEAST_GAIN or best.value > before:
                break
            q = starts.solve(x0[k], b0[k], near=best.start.q)
            best.consider(None if q is None else Start(x0[k], b0[k], q))
        if best.value == before:
            scale *= 0.5


class LicSelector:
    """Selects by optimising an estimator over base, torso, hand pose and arm; for every robot.

    A first attempt is chosen with LIC-1, a further one with LIC-2, which knows how the attempts
    before it failed. Without LIC-2, further attempts are LIC-1's best away from the failed ones.

    Candidates are compared first: the discrete starts and a lattice between them. From the best a
    `LicProgram` is solved, and a pattern search goes on from where it ends, because estimates have
    kinks; the answer is the best feasible start of all, whatever the solver reports. Who finds what
    is in scripts/selection/README.md.
    """

    def __init__(
        self, first: SuccessModel, second: SuccessModel | None = None, method: str = "lic"
    ) -> None:
        """Sets up a selector with LIC-1's fitted model and LIC-2's, if there is one."""
        self.first, self.second, self.method = first, second, method

    def select(self, situation: Situation) -> Selection:
        """Returns the best start found; see `solve`."""
        return self.solve(self.program(situation))

    def program(self, situation: Situation) -> LicProgram:
        """Returns the optimisation of a situation, to which constraints and costs may be added."""
        return LicProgram(situation, self.objective(situation))

    def solve(self, program: LicProgram) -> Selection:
        """Returns the best start found that satisfies all constraints of a program.

        Raises:
            RequestError: No start is left away from the failed ones, or none was found that
                satisfies what was added to the program.
        """
        began = time.perf_counter()
        situation, starts = program.situation, program.situation.starts
        effort, num_discrete = starts.effort, len(starts.grid)
        regions = starts.regions if program.objective.failed else situation.free_regions()
        candidates, values = self.search(program)
        order = np.argsort(-values, kind="stable")
        best = _Best(program)
        if len(order) and values[order[0]] > -np.inf:
            best.consider(candidates[int(order[order < num_discrete][0])])
        region_of = find_regions(regions, candidates)
        tried: Counter[int] = Counter()
        solved: Counter[int] = Counter()
        for k in order:
            if values[k] == -np.inf or solved.total() >= effort.solves:
                break
            region = int(region_of[k])
            if tried[region] == 0 and values[k] < best.value - effort.max_gain:
                tried[region] = _MAX_TRIED
            if tried[region] >= _MAX_TRIED or solved[region] >= effort.solves_per_region:
                continue
            tried[region] += 1
            start: Start | None = candidates[int(k)]
            if start is not None and start.q is None:
                start = starts.nearest(start.x0, start.b0)
            if start is None:
                continue
            solved[region] += 1
            best.consider(start)
            # A candidate just beside the end of a region is one that nothing can improve.
            if region >= 0:
                best.consider(self.improve(program, regions[region], start))
        if best.start is None and not len(starts.grid):
            raise RequestError("no discrete start is feasible here")
        if best.start is None:
            raise RequestError(
                "no start is left away from the failed ones that satisfies the constraints of the"
                " program; loosen what was added to it"
            )
        estimate = program.estimates(Starts.of(best.start))[0]
        return Selection(
            start=best.start,
            probability=float(np.clip(estimate, 0.0, 1.0)),
            method=self.method,
            seconds=time.perf_counter() - began,
        )

    def objective(self, situation: Situation) -> SuccessObjective:
        """Returns what is maximised in a situation."""
        if self.second is not None:
            seen = []
            for reach in situation.failed:
                with suppress(EstimateError):  # One that never began shows less than is asked for.
                    self.second.features.observation(reach.shown)
                    seen.append(reach)
            if seen:
                return Objective(model=self.second, p_WG=situation.p_WG, failed=tuple(seen))
        return Objective(model=self.first, p_WG=situation.p_WG)

    def search(self, program: LicProgram) -> tuple[Starts, Vector]:
        """Returns n candidates, discrete starts and then a lattice, and their values, shape (n,).

        Those without joint angles may be infeasible. The value of a forbidden one is -inf.
        """
        starts = program.situation.starts
        grid = starts.grid
        of_grid = self._values(program, grid)
        if np.all(of_grid == -np.inf):
            return grid, of_grid
        places = starts.lattice(of_grid)
        return grid.join(places), np.append(of_grid, self._values(program, places))

    def improve(self, program: LicProgram, region: Region, start: Start) -> Start | None:
        """Returns where the optimisation in a region ends from a start, if it is feasible."""
        best = _Best(program)
        best.consider(start)
        best.consider(program.situation.starts.snap(region, program.solve(region, start)))
        climb(program, region, best)
        return best.start

    def _values(self, program: LicProgram, candidates: Starts) -> Vector:
        """Returns values of n candidates, shape (n,), -inf where they are ruled out."""
        # From what violates a constraint that was added, after all others, a solver may find a way.
        violated = ~program.satisfied(candidates)
        values = program.values(candidates) - _VIOLATED * violated
        if not program.objective.failed:
            values[~program.situation.allowed(candidates)] = -np.inf
        return values
