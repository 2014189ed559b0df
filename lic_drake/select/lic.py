"""LIC-1 and LIC-2: the start with the highest estimated probability of success (paper III)."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np

from lic_drake.errors import EstimateError, RequestError
from lic_drake.reach.start import Starts
from lic_drake.select.baselines import make_selection
from lic_drake.select.objective import Objective, SuccessModel, SuccessObjective
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.types import Vector


class LicSelector(ABC):
    """Selects by optimising an estimator from many starts; how, says the subclass of a robot.

    A first attempt is chosen with LIC-1, a further one with LIC-2, which knows how the attempts
    before it failed. Without LIC-2, further attempts are LIC-1's best away from the failed ones.

    The answer is never worse than the best candidate seen, whatever the solver reports, and is
    checked with the closed-form inverse kinematics.
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
        began = time.perf_counter()
        objective = self.objective(situation)
        candidates = self._candidates(situation)
        if not objective.failed:
            candidates = candidates.take(situation.allowed(candidates))
        if len(candidates) == 0:
            raise RequestError("no start is left away from the failed ones")
        values = objective.values(candidates) * self._chance(situation, candidates)
        order = np.argsort(-values, kind="stable")
        best = candidates.take(order[:1])
        best_value = float(values[order[0]])
        for improved in self._improve(situation, objective, candidates, values):
            value = float((objective.values(improved) * self._chance(situation, improved))[0])
            if value > best_value:
                best, best_value = improved, value
        probability = float(np.clip(best_value, 0.0, 1.0))
        return make_selection(situation, best, 0, probability, self.method, began)

    def objective(self, situation: Situation) -> SuccessObjective:
        """Returns what is maximised in a situation."""
        seen = self._observable(situation.failed)
        if self.second is not None and seen:
            return Objective(model=self.second, p_WG=situation.p_WG, failed=seen)
        return Objective(model=self.first, p_WG=situation.p_WG)

    def _chance(self, situation: Situation, conditions: Starts) -> Vector:
        """Returns how likely n initial conditions are what they seem to be, shape (n,)."""
        return np.ones(len(conditions))

    @abstractmethod
    def _candidates(self, situation: Situation) -> Starts:
        """Returns possible initial conditions to begin with."""

    @abstractmethod
    def _improve(
        self,
        situation: Situation,
        objective: SuccessObjective,
        candidates: Starts,
        values: Vector,
    ) -> Iterable[Starts]:
        """Yields where the optimisation ends from the best candidates, one possible start each.

        Args:
            situation: What was asked.
            objective: What is maximised.
            candidates: Possible starts, n.
            values: Their estimates, times how likely they are what they seem, shape (n,).
        """

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
