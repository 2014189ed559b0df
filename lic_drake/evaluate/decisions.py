"""The best decision in a situation, learned from anybody's rollouts, and how likely it succeeds."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.rollouts import Rollouts
from lic_drake.estimate.rows import feature_scale, selection_folds
from lic_drake.evaluate.reliability import FEWEST, Reliability
from lic_drake.seeds import make_generator
from lic_drake.select.registry import fit_rows, silent
from lic_drake.types import BoolVector, IntVector, Vector

_FEWEST_LIKE = 5
"""Attempts among which one is the best of a set, as a decision is the best of many."""

_MAX_TRIED = 2000
_NUM_IMPROVED = 4


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What to decide in a situation.

    Attributes:
        at: The situation.
        values: The decision.
        estimate: Of P(success), the highest of all decisions and so rather too high.
        probability: How often choices with such an estimate succeed; None: not known.
        interval: 90 % interval of that rate. It holds what few choices leave open, not that a
            decision found by optimisation is better, or worse, than the best of some that were
            tried.
    """

    at: dict[str, float]
    values: dict[str, float]
    estimate: float
    probability: float | None
    interval: tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class DecisionModel:
    """What `fit_rollouts` learned.

    Attributes:
        rollouts: The attempts.
        estimator: P(success) of a situation followed by a decision.
        held_out: Estimates and successes of choices in groups that were held out, shape (m,) each;
            see `held_out_choices`.
        reliability: What those say of an estimate; None if there are too few.
    """

    rollouts: Rollouts
    estimator: SuccessEstimator
    held_out: tuple[Vector, BoolVector]
    reliability: Reliability | None

    def choose(self, at: Mapping[str, float]) -> Decision:
        """Returns the decision with the highest estimate, within the ranges seen in the table.

        Up to 2,000 decisions of the table are compared in the situation `at`, and the best ones
        improved by L-BFGS-B.

        Raises:
            RequestError: The situation is not one of the table's; see `Rollouts.situation`.
        """
        situation = self.rollouts.situation(at)
        tried = np.unique(self.rollouts.decisions, axis=0)
        low, high = tried.min(axis=0), tried.max(axis=0)
        if len(tried) > _MAX_TRIED:
            rng = make_generator("training", "decisions to compare")
            tried = rng.choice(tried, _MAX_TRIED, replace=False)
        values = self.values(situation, tried)

        def cost(z: Vector) -> tuple[float, Vector]:
            x = np.append(situation, low + z * (high - low))
            value, gradient = self.estimator.value_and_gradient(x)
            return -value, -gradient[len(situation) :] * (high - low)

        best = np.argsort(-values, kind="stable")[:_NUM_IMPROVED]
        bounds = [(0.0, 1.0)] * len(low)
        found = [
            minimize(cost, z, jac=True, method="L-BFGS-B", bounds=bounds).x
            for z in (tried[best] - low) / (high - low)
        ]
        candidates = np.vstack([tried[best[:1]], low + np.array(found) * (high - low)])
        values = self.values(situation, candidates)
        chosen, estimate = candidates[values.argmax()], float(values.max())
        known = self.reliability
        p = None if known is None else float(known.probabilities(np.array([estimate]))[0])
        return Decision(
            at=dict(zip(self.rollouts.given, situation.tolist(), strict=True)),
            values=dict(zip(self.rollouts.decide, chosen.tolist(), strict=True)),
            estimate=min(max(estimate, 0.0), 1.0),
            probability=p,
            interval=None if known is None else known.interval(estimate),
        )

    def values(self, situation: Vector, decisions: Vector) -> Vector:
        """Returns the unclipped estimates of n decisions, shape (n, k), in a situation: (n,)."""
        return self.estimator.values(
            np.column_stack([np.tile(situation, (len(decisions), 1)), decisions])
        )


def fit_rollouts(
    rollouts: Rollouts, method: str = "gp", say: Callable[[str], None] = silent
) -> DecisionModel:
    """Learns from anybody's attempts what to decide; see `DecisionModel.choose`.

    How likely a choice succeeds is learned from the same table: see `held_out_choices`.

    Args:
        rollouts: What `read_rollouts` returns.
        method: Estimator: gp (up to 8,000 rows), knn, or a registered one.
        say: Receives a line before and after a fit. Fits are kept and found again.
    """
    estimator = fit_rows(method, rollouts.rows, "rollouts", say=say)
    held_out = held_out_choices(estimator, rollouts)
    known = Reliability.fit(*held_out) if len(held_out[0]) >= FEWEST else None
    return DecisionModel(
        rollouts=rollouts, estimator=estimator, held_out=held_out, reliability=known
    )


def held_out_choices(estimator: SuccessEstimator, rollouts: Rollouts) -> tuple[Vector, BoolVector]:
    """Returns estimates and successes of m choices among attempts that were held out, shape (m,).

    A choice is the attempt with the highest estimate among `_FEWEST_LIKE` or more in like
    situations. Estimates are those of an estimator with the same settings that knows none of the
    groups of a fifth of the table, which is divided into such sets; no group is in two of them.
    """
    rows, scaled = rollouts.rows, rollouts.situations / feature_scale(rollouts.situations)
    fold, best = selection_folds(rows.groups, len(rows.y)), []
    estimates = np.empty(len(rows.y))
    for out in (fold == k for k in range(int(fold.max()) + 1)):
        seen = estimator.conditioned_on(rows.X[~out], rows.y[~out])
        estimates[out] = seen.values(rows.X[out])
        for like in _like_situations(np.flatnonzero(out), scaled, rows.groups):
            best.append(like[np.argmax(estimates[like])])
    return estimates[best], rows.y[best] == 1.0


def _like_situations(part: IntVector, scaled: Vector, groups: IntVector) -> Iterator[IntVector]:
    """Yields a part of the rows in sets of whole groups: halves of halves by situation."""
    column = scaled[part, np.argmax(np.ptp(scaled[part], axis=0))]
    group = np.unique(groups[part], return_inverse=True)[1]
    mean = np.bincount(group, weights=column) / np.bincount(group)
    order = np.lexsort((group, mean[group]))
    cuts = np.flatnonzero(np.diff(group[order])) + 1
    cut = cuts[np.argmin(np.abs(2 * cuts - len(part)))] if len(cuts) else 0
    if min(cut, len(part) - cut) < _FEWEST_LIKE:
        yield part
        return
    for half in (order[:cut], order[cut:]):
        yield from _like_situations(part[half], scaled, groups)
