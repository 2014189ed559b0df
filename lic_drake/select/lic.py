"""LIC-1 and LIC-2: the start with the highest estimated probability of success (paper III)."""

import time
from collections import Counter
from itertools import product

import numpy as np

from lic_drake.errors import EstimateError, RequestError
from lic_drake.reach.start import Start, Starts
from lic_drake.select.objective import Objective, SuccessModel, SuccessObjective
from lic_drake.select.program import LicProgram
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.starts import Region, find_regions
from lic_drake.types import Vector

FIRST_STEP = 1.0 / 16.0
"""First step of a pattern search, as a share of the region's width."""

SMALLEST_STEP = 1e-6
"""A pattern search ends at this share of the region's width."""

MAX_TRIED = 40
"""Number of candidates of a region that are tried, best first, until one is feasible."""

LEAST_GAIN = 1e-9
"""Smallest improvement that counts; less is rounding."""

VIOLATED = 1e6
"""Penalty of candidates that violate a constraint."""


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
        if value <= self.value + LEAST_GAIN or not program.satisfied(asked)[0]:
            return
        if program.objective.failed or program.situation.allowed(asked)[0]:
            self.start, self.value = start, value


def climb(program: LicProgram, region: Region, best: _Best) -> None:
    """Improves a start by a pattern search over hand, base and torso within a region.

    An L1 kernel and K-NN have kinks, on which a solver that follows gradients stops early.
    """
    starts = program.situation.starts
    widths = region.upper[:3] - region.lower[:3], region.b0_upper - region.b0_lower
    width = np.concatenate(widths)
    free = np.flatnonzero(width > SMALLEST_STEP)
    steps = np.zeros((3 ** len(free), 6))
    steps[:, free] = width[free] * list(product((-1.0, 0.0, 1.0), repeat=len(free)))
    scale = FIRST_STEP
    while best.start is not None and scale > SMALLEST_STEP:
        before = best.value
        x0 = np.tile(best.start.x0, (len(steps), 1))
        x0[:, :3] += scale * steps[:, :3]
        x0 = np.clip(x0, region.lower, region.upper)
        b0 = np.round(best.start.b0 + scale * steps[:, 3:], 6)
        b0 = np.clip(b0, region.b0_lower, region.b0_upper)
        values = program.values(Starts(x0, b0))
        for k in np.argsort(-values, kind="stable"):
            if values[k] <= before + LEAST_GAIN or best.value > before:
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
        """Sets up a selector.

        Args:
            first: LIC-1's fitted model.
            second: LIC-2's, if there is one.
            method: Name for the selections.
        """
        self.method = method
        self.first = first
        self.second = second

    def select(self, situation: Situation) -> Selection:
        """Returns the best start found.

        Raises:
            RequestError: No start is left away from the failed ones.
        """
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
        best = self._best(program)
        probability = float(np.clip(program.estimates(Starts.of(best))[0], 0.0, 1.0))
        seconds = time.perf_counter() - began
        return Selection(start=best, probability=probability, method=self.method, seconds=seconds)

    def objective(self, situation: Situation) -> SuccessObjective:
        """Returns what is maximised in a situation."""
        seen = self._observable(situation.failed)
        if self.second is not None and seen:
            return Objective(model=self.second, p_WG=situation.p_WG, failed=seen)
        return Objective(model=self.first, p_WG=situation.p_WG)

    def search(self, program: LicProgram) -> tuple[Starts, Vector]:
        """Returns n candidates, the discrete starts first, and their values, shape (n,).

        After those comes a lattice. Candidates without joint angles may be infeasible. The value of
        a forbidden one is -inf.
        """
        starts = program.situation.starts
        grid = starts.grid
        of_grid = self._values(program, grid)
        if np.all(of_grid == -np.inf):
            return grid, of_grid
        places = starts.lattice(of_grid)
        return grid.join(places), np.append(of_grid, self._values(program, places))

    def improve(self, program: LicProgram, region: Region, start: Start) -> Start | None:
        """Returns where the optimisation ends from a start, None if the arm cannot be near there.

        Args:
            program: The optimisation.
            region: A region that holds the start.
            start: Where to begin, with joint angles.
        """
        best = _Best(program)
        best.consider(start)
        best.consider(program.situation.starts.snap(region, program.solve(region, start)))
        climb(program, region, best)
        return best.start

    def _best(self, program: LicProgram) -> Start:
        """Returns the best feasible start found.

        Raises:
            RequestError: There is none.
        """
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
                tried[region] = MAX_TRIED
            if tried[region] >= MAX_TRIED or solved[region] >= effort.solves_per_region:
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
        if best.start is None:
            raise RequestError(
                "no start is left away from the failed ones that satisfies the constraints of the"
                " program; loosen what was added to it"
            )
        return best.start

    def _values(self, program: LicProgram, candidates: Starts) -> Vector:
        """Returns values of n candidates, shape (n,), -inf where they are ruled out.

        What violates a constraint that was added comes after all others: a solver may still find
        the way from there.
        """
        violated = ~program.satisfied(candidates)
        values = program.values(candidates) - VIOLATED * violated
        if not program.objective.failed:
            values[~program.situation.allowed(candidates)] = -np.inf
        return values

    def _observable(self, failed: tuple[FailedReach, ...]) -> tuple[FailedReach, ...]:
        """Returns the failures that show all that LIC-2 asks for: those that began at all."""
        if self.second is None:
            return ()
        seen = []
        for reach in failed:
            try:
                self.second.features.observation(reach.shown)
            except EstimateError:
                continue
            seen.append(reach)
        return tuple(seen)
