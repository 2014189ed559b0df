"""Compares selections where the clutter is either cylinder-clutter or passage-clutter.

    python scripts/unknown_category/run.py

Goals are drawn from passages in both, so that they carry no information about the category. An
interrupted run can be resumed.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from lic_drake.evaluate.statistics import Count, count, mcnemar
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.evaluate.trials import TrialRow, TrialTable, write_trials
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import Selector, make_selector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts
from lic_drake.types import BoolVector
from scripts.common import add_results, make_parser, run_script, write_tables
from scripts.unknown_category.final_position import FinalPositions
from scripts.unknown_category.mixture import Category, MixtureLic

CATEGORIES = ("cylinder-clutter", "passage-clutter")
STREAM = "evaluation"

COMMON_STARTS = "{task: {start_line: {phi_step_deg: 15.0}}}"
"""Put over the scenarios, whose grids of starts are 30 and 45 degrees apart on the same line: this
one holds both, and optimisations begin from the same candidates in both."""

NAMES = {
    "known": "the category is known",
    "final": "mixture, updated by the failure and its final position",
    "failure": "mixture, updated by the failure",
    "fixed": "mixture, not updated",
    "wrong": "the other category is taken for certain",
}
"""Strategies and what tables call them."""

Beliefs = dict[str, dict[str, list[float]]]
"""P(true category) after each first failure, by strategy and true category."""


def common_scenario(library: ExperienceLibrary) -> Scenario:
    """Returns the scenario of a library with the starts that both categories share."""
    return library.scenario(COMMON_STARTS)


def make_strategies(
    libraries: Mapping[str, ExperienceLibrary], estimator: str
) -> dict[str, dict[str, Selector]]:
    """Returns the strategies of `NAMES` by the category that the environment truly is of.

    Args:
        libraries: Of two categories; arm and start line are the same.
        estimator: Of LIC.
    """
    arm = common_scenario(next(iter(libraries.values()))).arm()
    assert arm.is_planar
    known: dict[str, LicSelector] = {}
    final: dict[str, FinalPositions] = {}
    for name, library in libraries.items():
        columns = library.columns()
        selector = make_selector(estimator, arm, columns, category=name)
        assert isinstance(selector, LicSelector)
        known[name] = selector
        final[name] = FinalPositions.fit(selector.first.features, columns)

    def mixture(*, use_final: bool = False, updates: bool = True) -> MixtureLic:
        categories = {
            name: Category(probability=0.5, lic=lic, final=final[name] if use_final else None)
            for name, lic in known.items()
        }
        return MixtureLic(categories, updates=updates)

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


class KeptReaches:
    """The reaches of one scenario, in memory and in a library."""

    def __init__(
        self, folder: Path, scenario: Scenario, make: Callable[[ReachRequest], ReachRecord]
    ) -> None:
        self._library, self._scenario, self._make = ExperienceLibrary(folder), scenario, make
        self._library.create()
        has_rows = bool(self._library.shard_paths())
        self._known = {r.key: r for r in self._library.records()} if has_rows else {}
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
            self._library.compact()


def compare(
    libraries: Mapping[str, ExperienceLibrary],
    goals: Scenario,
    results: Path,
    environments: Sequence[int],
    reach: Callable[[ReachRequest], ReachRecord] = run_reach,
    estimator: str = "gp",
) -> tuple[list[TrialRow], Beliefs]:
    """Makes two attempts with every strategy in environments of both categories.

    Reaches are kept and not simulated again.

    Args:
        libraries: Of two categories.
        goals: The scenario that goals are drawn from.
        results: Folder for trials and reaches.
        environments: Indices of the environments, the same in both categories.
        reach: Makes a request's reach.
        estimator: Of LIC.

    Returns:
        The rows of the trials, of which the variant is the true category, and the beliefs.
    """
    strategies = make_strategies(libraries, estimator)
    rows: list[TrialRow] = []
    beliefs: Beliefs = {name: {truth: [] for truth in strategies} for name in ("final", "failure")}
    for truth, selectors in strategies.items():
        scenario = common_scenario(libraries[truth])
        kept = KeptReaches(results / truth, scenario, reach)
        for environment in environments:
            p_WG = goals.sample_goal(STREAM, environment)
            starts = make_starts(scenario, scenario.sample_instance(STREAM, environment))
            for strategy, selector in selectors.items():
                done = run_trial(scenario, selector, STREAM, environment, p_WG, 2, reach=kept.reach)
                rows += _rows(truth, strategy, environment, done)
                if strategy in beliefs and not done[0].record.success:
                    assert isinstance(selector, MixtureLic)
                    failed = (FailedReach.from_record(done[0].record),)
                    belief = selector.belief(Situation(p_WG=p_WG, starts=starts, failed=failed))
                    beliefs[strategy][truth].append(belief[truth])
            kept.save()
            print(f"{truth}: environment {environment}", flush=True)
    write_trials(results / "trials.parquet", rows)
    return rows, beliefs


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


def unknown_category_table(rows: Sequence[TrialRow], beliefs: Beliefs) -> Table:
    """Returns success of each strategy, over all environments and by their true category.

    Args:
        rows: See `compare`.
        beliefs: See `compare`.
    """
    trials = TrialTable(rows)
    truths = trials.variants

    def won(strategy: str, attempts: int) -> BoolVector:
        return np.concatenate([trials.success(strategy, attempts, truth) for truth in truths])

    lines = []
    for strategy, name in NAMES.items():
        each = [count(trials.success(strategy, 2, truth)) for truth in truths]
        p = "" if strategy == "fixed" else f"{mcnemar(won(strategy, 2), won('fixed', 2)):.2g}"
        believed = np.array([p for of in beliefs.get(strategy, {}).values() for p in of])
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


def _cell(result: Count) -> str:
    rate, interval, counts = rate_cells(result)
    return f"{rate} ({interval}, {counts})"


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--environments", type=int, default=100, help="of each category")
    add_results(parser)
    args = parser.parse_args()
    libraries = {name: ExperienceLibrary(shipped_library(name)) for name in CATEGORIES}
    goals = common_scenario(libraries["passage-clutter"])
    folder = args.results / "unknown_category"
    rows, beliefs = compare(libraries, goals, folder, range(args.environments))
    write_tables(args.results, "unknown_category", [unknown_category_table(rows, beliefs)])


if __name__ == "__main__":
    run_script(main)
