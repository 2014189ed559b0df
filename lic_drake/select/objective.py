"""F(T_b0(s), x0) of paper Eq. (3) as a function of the initial condition, for one situation."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lic_drake.estimate.features import FeatureMap
from lic_drake.reach.start import Start, Starts
from lic_drake.select.situation import FailedReach
from lic_drake.types import Vector

if TYPE_CHECKING:
    from lic_drake.estimate.estimator import SuccessEstimator


@dataclass(frozen=True, kw_only=True)
class SuccessModel:
    """An estimator with the meaning of its features."""

    estimator: "SuccessEstimator"
    features: FeatureMap


class SuccessObjective(Protocol):
    """What the optimisation maximises over initial conditions, in one situation."""

    @property
    def failed(self) -> tuple[FailedReach, ...]:
        """Failures that are observed; without any, starts near failed ones are ruled out."""

    def values(self, conditions: Starts) -> Vector:
        """Returns the unclipped estimates at n initial conditions, shape (n,)."""

    def value_and_gradient(self, x0: Vector, b0: Vector) -> tuple[float, Vector, Vector]:
        """Returns the estimate and its gradients by x0 and by b0, shape (3,)."""


@dataclass(frozen=True, kw_only=True)
class Objective:
    """The estimated probability of success at a goal, after failed reaches.

    After several failures it is the smallest of the estimates that follow each of them: what one
    failure speaks against, no other can recommend. Without any to observe the model is LIC-1's.
    """

    model: SuccessModel
    p_WG: Vector
    failed: tuple[FailedReach, ...] = ()

    def values(self, conditions: Starts) -> Vector:
        """Returns the unclipped estimates at n initial conditions, shape (n,)."""
        p_RG, x0, join = self.p_WG - conditions.b0, conditions.in_R, self.model.features.join
        seen = self._observed(conditions.b0)
        values = [self.model.estimator.values(join(p_RG, x0, o)) for o in seen]
        return np.array(values).min(axis=0)

    def value_and_gradient(self, x0: Vector, b0: Vector) -> tuple[float, Vector, Vector]:
        """Returns the estimate and its gradients by x0 and by b0, shape (3,)."""
        features, x0_R = self.model.features, Start(x0, b0).x0_R
        candidates = [
            self.model.estimator.value_and_gradient(features.join(self.p_WG - b0, x0_R, seen))
            for seen in self._observed(b0)
        ]
        value, by_z = min(candidates, key=lambda candidate: candidate[0])
        return value, features.gradient_by_x0(by_z), features.gradient_by_base(by_z)

    def _observed(self, b0: Vector) -> list[Vector | None]:
        if not self.failed:
            return [None]
        return [self.model.features.observation(failed.shown, b0) for failed in self.failed]
