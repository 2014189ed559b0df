"""Selection where the category of the clutter is known by a probability only.

The start is the one with the highest probability of success under the mixture of the categories,

    max over x0 of  sum_c P(c) P(success | s, x0, c),

and every failure updates P(c) by Bayes' rule, with its likelihood under each category.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lic_drake.reach.start import Starts
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessObjective
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.types import Vector
from scripts.unknown_category.final_position import FinalPositions

LEAST_PROBABILITY = 0.02
"""Lower bound on the probabilities in Bayes' rule: an overconfident estimator must not rule out a
category by a single reach."""


def posterior(prior: Vector, log_likelihood: Vector) -> Vector:
    """Returns P(c | what was seen), shape (k,), from P(c) and log P(what was seen | c)."""
    with np.errstate(divide="ignore"):  # A category of no probability keeps it.
        score = np.log(prior) + log_likelihood
    weight = np.exp(score - score.max())
    return np.asarray(weight / weight.sum())


@dataclass(frozen=True, kw_only=True)
class MixtureObjective:
    """The mixture of what categories estimate; satisfies `SuccessObjective`.

    Attributes:
        parts: One objective for each category.
        weight: Probability of each, shape (k,).
    """

    parts: tuple[SuccessObjective, ...]
    weight: Vector

    @property
    def failed(self) -> tuple[FailedReach, ...]:
        """Failures that all categories observe."""
        return self.parts[0].failed if all(part.failed for part in self.parts) else ()

    def values(self, conditions: Starts) -> Vector:
        """Returns the estimates at n initial conditions, shape (n,); see `SuccessObjective`."""
        return np.asarray(self.weight @ [part.values(conditions) for part in self.parts])

    def value_and_gradient(self, x0: Vector, b0: Vector) -> tuple[float, Vector, Vector]:
        """Returns the estimate and its gradients by x0 and b0; see `SuccessObjective`."""
        found = [part.value_and_gradient(x0, b0) for part in self.parts]
        values, by_x0, by_b0 = (np.array(column) for column in zip(*found, strict=True))
        return float(self.weight @ values), self.weight @ by_x0, self.weight @ by_b0


@dataclass(frozen=True, kw_only=True)
class Category:
    """A category that an environment may be of.

    Attributes:
        probability: P(c) before any reach.
        lic: LIC for it.
        final: Where its failures end; None: final positions tell nothing.
    """

    probability: float
    lic: LicSelector
    final: FinalPositions | None = None


class MixtureLic(LicSelector):
    """LIC for a planar arm in clutter of an unknown category.

    A first attempt is chosen by the mixture of the LIC-1 of all categories, a further one by that
    of their LIC-2. The candidates are the starts of the situation, whichever category's they are;
    the optimisation moves between them.

    Attributes:
        categories: The categories by name; their probabilities add up to 1.
        updates: Whether failures update the belief.
    """

    def __init__(self, categories: Mapping[str, Category], *, updates: bool = True) -> None:
        self.categories = dict(categories)
        self.updates = updates
        self._prior = np.array([category.probability for category in categories.values()])
        likeliest = list(categories.values())[int(np.argmax(self._prior))].lic
        super().__init__(likeliest.first, likeliest.second, "mixture")

    def objective(self, situation: Situation) -> MixtureObjective:
        """Returns what is maximised in a situation."""
        parts = tuple(c.lic.objective(situation) for c in self.categories.values())
        belief = self.belief(situation)
        return MixtureObjective(parts=parts, weight=np.array([belief[c] for c in self.categories]))

    def belief(self, situation: Situation) -> dict[str, float]:
        """Returns P(c) after the failures of a situation.

        Each failure counts with the probability of failing where it began and, if its final
        position is known, the density of ending there. The order of the failures matters, because
        LIC-2 takes the earlier ones into account.
        """
        belief = self._prior
        if self.updates:
            for number, failed in enumerate(situation.failed):
                before = replace(situation, failed=situation.failed[:number])
                likelihood = [
                    log_likelihood(category, before, failed)
                    for category in self.categories.values()
                ]
                belief = posterior(belief, np.array(likelihood))
        return dict(zip(self.categories, belief.tolist(), strict=True))


def log_likelihood(category: Category, before: Situation, failed: FailedReach) -> float:
    """Returns log p(failure, final position | category) of a reach.

    Args:
        category: The category.
        before: What was known before the reach.
        failed: The reach.
    """
    start = Starts.of(failed.start)
    success = float(category.lic.objective(before).values(start)[0])
    result = np.log(np.clip(1.0 - success, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY))
    p_WE = np.array([failed.shown.get(f"final_{axis}", np.nan) for axis in "xy"])
    if category.final is not None and np.all(np.isfinite(p_WE)):
        z = category.lic.first.features.join(before.p_WG - start.b0[0], start.in_R[0])
        result += category.final.log_density(z, (p_WE - failed.start.b0[:2])[None])[0]
    return float(result)
