"""How well starts are chosen where the category of the clutter is not known for certain."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.evaluate.statistics import Count, count, mcnemar
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.evaluate.trials import TrialRow, TrialTable, write_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.starts import make_starts
from lic_drake.select.planar_lic import PlanarLic
from lic_drake.select.registry import Selector, make_selector
from lic_drake.select.situation import FailedReach, Situation
from scripts.unknown_category.final_position import FinalPositions
from scripts.unknown_category.mixture import Category, MixtureLic
from scripts.unknown_category.mixture_maker import check_comparable, with_common_starts

STREAM = "evaluation"
"""Seed stream of the environments."""

NAMES = {
    "known": "the category is known",
    "final": "mixture, updated by the failure and its final position",
    "failure": "mixture, updated by the failure",
    "fixed": "mixture, not updated",
    "wrong": "the other category is taken for certain",
}
"""Strategies and what tables call them."""

SAVE_EVERY = 20
"""Trials between two writings of the reaches."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Two categories that are mistaken for each other.

    Attributes:
        libraries: A library for each category; arm and start line are the same.
        goals_of: The category that goals are drawn from, so that they tell nothing.
        results: Folder for trials and reaches.
    """

    libraries: Mapping[str, ExperienceLibrary]
    goals_of: str
    results: Path

    def scenario(self, category: str) -> Scenario:
        """Returns the scenario that is tried, with the common starts."""
        return with_common_starts(self.libraries[category])


def make_strategies(comparison: Comparison, estimator: str) -> dict[str, dict[str, Selector]]:
    """Returns the strategies of `NAMES` by the category that the environment truly is of.

    Raises:
        RequestError: There are not two categories, or they do not share arm and start line.
    """
    scenarios = {name: comparison.scenario(name) for name in comparison.libraries}
    if len(scenarios) != 2:
        raise RequestError(f"two categories are compared, got {', '.join(scenarios)}")
    arm = check_comparable(scenarios)
    known: dict[str, PlanarLic] = {}
    final: dict[str, FinalPositions] = {}
    for name, library in comparison.libraries.items():
        columns = library.columns()
        selector = make_selector(estimator, arm, columns, category=name)
        assert isinstance(selector, PlanarLic)
        known[name] = selector
        final[name] = FinalPositions.fit(selector.first.features, columns)

    def mixture(*, use_final: bool = False, updates: bool = True) -> MixtureLic:
        categories = {
            name: Category(probability=0.5, lic=lic, final=final[name] if use_final else None)
            for name, lic in known.items()
        }
        return MixtureLic(arm, categories, updates=updates)

    mixtures: dict[str, Selector] = {
        "final": mixture(use_final=True),
        "failure": mixture(),
        "fixed": mixture(updates=False),
    }
    first, second = known
    return {
        name: {"known": known[name], **mixtures, "wrong": known[wrong]}
        for name, wrong in ((first, second), (second, first))
    }


def compare(
    comparison: Comparison,
    environments: Sequence[int],
    say: Callable[[str], None] = print,
    reach: Callable[[ReachRequest], ReachRecord] = run_reach,
    estimator: str = "gp",
) -> tuple[list[TrialRow], dict[str, dict[str, list[float]]]]:
    """Makes two attempts with every strategy in environments of both categories.

    Reaches are kept and not simulated again.

    Args:
        comparison: What is compared.
        environments: Indices of the environments, the same in both categories.
        say: Gets a line now and then.
        reach: Makes a request's reach.
        estimator: Of LIC.

    Returns:
        The rows of the trials, of which the variant is the true category, and what the mixtures
        that are updated believed of the true category after a first failure, by strategy and true
        category.
    """
    strategies = make_strategies(comparison, estimator)
    goals = comparison.scenario(comparison.goals_of)
    rows: list[TrialRow] = []
    beliefs: dict[str, dict[str, list[float]]] = {
        strategy: {truth: [] for truth in strategies} for strategy in ("final", "failure")
    }
    for truth, selectors in strategies.items():
        scenario = comparison.scenario(truth)
        library = _Reaches(ExperienceLibrary(comparison.results / truth), scenario, reach)
        for number, environment in enumerate(environments, start=1):
            p_WG = goals.sample_goal(STREAM, environment)
            starts = make_starts(scenario, scenario.sample_instance(STREAM, environment))
            for strategy, selector in selectors.items():
                done = run_trial(
                    scenario, selector, STREAM, environment, p_WG, 2, reach=library.reach
                )
                rows += _rows(truth, strategy, environment, done)
                if strategy in beliefs and not done[0].record.success:
                    assert isinstance(selector, MixtureLic)
                    failed = (FailedReach.from_record(done[0].record),)
                    belief = selector.belief(Situation(p_WG=p_WG, starts=starts, failed=failed))
                    beliefs[strategy][truth].append(belief[truth])
            if number % SAVE_EVERY == 0 or number == len(environments):
                library.save()
                say(f"{truth}: {number}/{len(environments)} environments")
        library.compact()
    write_trials(comparison.results / "trials.parquet", rows)
    return rows, beliefs


def unknown_category_table(
    rows: Sequence[TrialRow], beliefs: Mapping[str, Mapping[str, Sequence[float]]]
) -> Table:
    """Returns success of each strategy, over all environments and by their true category.

    Args:
        rows: See `compare`.
        beliefs: See `compare`.
    """
    trials = TrialTable(rows)
    truths = trials.variants

    def won(strategy: str, attempts: int) -> np.ndarray:
        return np.concatenate([trials.success(strategy, attempts, truth) for truth in truths])

    lines = []
    for strategy, name in NAMES.items():
        each = [count(trials.success(strategy, 2, truth)) for truth in truths]
        p = "" if strategy == "fixed" else f"{mcnemar(won(strategy, 2), won('fixed', 2)):.2g}"
        believed = np.concatenate([list(v) for v in beliefs.get(strategy, {}).values()] or [[]])
        lines.append(
            (
                name,
                *(_cell(count(won(strategy, attempts))) for attempts in (1, 2)),
                *map(_cell, each),
                p,
                f"{100 * np.mean(believed > 0.5):.0f} ({len(believed)})" if len(believed) else "",
            )
        )
    return Table(
        caption=f"Two attempts where the category is one of {' and '.join(truths)}, P = 1/2 each.",
        heading=(
            "selection",
            "first attempt, %",
            "two attempts, %",
            *(f"two in {truth}, %" for truth in truths),
            "McNemar's p of two against no update",
            "true category the likelier one after a failure, % (failures)",
        ),
        rows=tuple(lines),
        remarks=("In brackets Wilson 90 % intervals and counts.",),
    )


class _Reaches:
    """The reaches of one scenario, in memory and in a library."""

    def __init__(
        self,
        library: ExperienceLibrary,
        scenario: Scenario,
        reach: Callable[[ReachRequest], ReachRecord],
    ) -> None:
        library.create()
        self._library, self._scenario, self._make = library, scenario, reach
        self._known = {r.key: r for r in library.records()} if library.shard_paths() else {}
        self._new: list[ReachRecord] = []

    def reach(self, request: ReachRequest) -> ReachRecord:
        """Returns the record of a request, simulated if it is not known."""
        if request.key not in self._known:
            self._known[request.key] = self._make(request)
            self._new.append(self._known[request.key])
        return self._known[request.key]

    def save(self) -> None:
        """Writes what is new."""
        if self._new:
            self._library.write_shard(f"new-{self._new[0].key}", self._new, self._scenario)
            self._new = []

    def compact(self) -> None:
        """Makes one file of all."""
        self._library.compact()


def _rows(truth: str, strategy: str, environment: int, done: Sequence[Attempt]) -> list[TrialRow]:
    return [
        TrialRow(
            variant=truth,
            method=strategy,
            environment=environment,
            goal=0,
            attempt=number,
            key=attempt.request.key,
            success=attempt.record.success,
            probability=float("nan")
            if attempt.selection.probability is None
            else attempt.selection.probability,
            seconds=attempt.selection.seconds,
        )
        for number, attempt in enumerate(done, start=1)
    ]


def _cell(result: Count) -> str:
    low, high = result.interval()
    return (
        f"{100 * result.rate:.1f} ({100 * low:.1f}..{100 * high:.1f},"
        f" {result.successes}/{result.trials})"
    )
