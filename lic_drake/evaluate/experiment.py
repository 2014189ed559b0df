"""Evaluation of several strategies on the same unseen environments, one task each."""

import gc
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from uuid import uuid4

import numpy as np

from lic_drake.evaluate.trial import run_trial
from lic_drake.evaluate.trials import TrialRow, read_trials, write_trials
from lic_drake.experience.pairs import pair_second_attempts
from lic_drake.experience.runner import Task, refuse_failed, run_tasks, shard_name
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.perception.config import CamerasConfig, load_cameras
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario, parse_scenario
from lic_drake.reach.session import run_reach
from lic_drake.seeds import make_generator
from lic_drake.select.baselines import RandomSelector
from lic_drake.select.registry import (
    FallbackSelector,
    Selector,
    check_method,
    make_selector,
    needs_library,
)

SAY_S = 5.0
"""Time between two progress messages, seconds."""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """The parameters of an evaluation; plain data that can be pickled.

    Attributes:
        experience: Library that the strategies learn from; its scenario is the default.
        results: Folder for `trials.parquet` and the library `reaches`.
        methods: Strategies, see `lic_drake.select.registry.check_method`.
        environments: Number of environments, from index `first_environment`.
        goals: Number of random goals in each.
        attempts: Maximum number of attempts at a goal.
        stream: Seed stream of environments and goals.
        first_environment: Index of the first environment.
        fresh: Whether the environment is reset before later attempts.
        variant: Name of these trials among others in the same folder.
        common_goals: Whether all environments have the goals of the first one.
        second_attempts: Library of real second attempts for LIC-2; None: D2 is composed of single
            reaches, as in the paper.
        overrides: YAML text merged into the scenario, for instance to block apertures.
        moves: Whether a PR2 may move base and torso before a reach.
        scenario_name: Name or path of a scenario other than the library's, to evaluate transfer
            between categories.
        cameras: Cameras that perceive apertures and goal, see
            `lic_drake.perception.config.load_cameras`; empty: both are known. With cameras, a reach
            succeeds if it ends in the ball.
    """

    experience: Path
    results: Path
    methods: tuple[str, ...]
    environments: int
    goals: int
    attempts: int = 2
    stream: str = "evaluation"
    first_environment: int = 0
    fresh: bool = False
    variant: str = ""
    common_goals: bool = False
    second_attempts: Path | None = None
    overrides: str = ""
    moves: bool = True
    scenario_name: str = ""
    cameras: str = ""

    @property
    def trials_path(self) -> Path:
        """File with one row per attempt."""
        return self.results / "trials.parquet"

    @property
    def reaches(self) -> ExperienceLibrary:
        """The reaches of all attempts."""
        return ExperienceLibrary(self.results / "reaches")

    def scenario(self) -> Scenario:
        """Returns the evaluated scenario.

        Raises:
            LicError: The library cannot be read, or an override is invalid.
        """
        if self.scenario_name:
            return load_scenario(self.scenario_name, self.overrides)
        scenario = ExperienceLibrary(self.experience).scenario()
        if not self.overrides:
            return scenario
        return parse_scenario(scenario_text(scenario), self.overrides, source="--set")


def run_evaluation(
    evaluation: Evaluation, workers: Workers | None = None, say: Callable[[str], None] = print
) -> list[TrialRow]:
    """Runs every strategy on the same goals in the same environments.

    Stored reaches (one shard per environment) are reused; selections are always recomputed.

    Args:
        evaluation: The parameters.
        workers: Where to run it; this process by default.
        say: Receives progress messages.

    Returns:
        The rows of these trials; the file also keeps those of other variants and strategies.

    Raises:
        LicError: A method is unknown, a library cannot be read or written, or an environment
            failed; reaches of finished environments are kept.
    """
    for method in evaluation.methods:
        check_method(method)
    scenario = evaluation.scenario()
    library = evaluation.reaches
    library.create()
    library.check_scenario(scenario, "the evaluation")
    plan = _Plan(
        name=uuid4().hex,
        evaluation=replace(  # Workers may run in other folders.
            evaluation,
            experience=evaluation.experience.absolute(),
            second_attempts=evaluation.second_attempts and evaluation.second_attempts.absolute(),
        ),
        scenario=scenario,
        cameras=load_cameras(evaluation.cameras) if evaluation.cameras else None,
    )
    first = evaluation.first_environment
    environments = range(first, first + evaluation.environments)
    began_s = time.perf_counter()
    next_say_s, done, simulated = began_s, 0, 0
    rows: list[TrialRow] = []

    def finish(task: Task, result: tuple[list[TrialRow], list[ReachRecord]]) -> None:
        nonlocal done, simulated
        new_rows, records = result
        if records:
            library.add_to_shard(task.name, records, scenario)
        rows.extend(new_rows)
        done += 1
        simulated += len(records)

    def report(at_work: int) -> None:
        nonlocal next_say_s
        now_s = time.perf_counter()
        if done and (now_s >= next_say_s or done == len(environments)):
            next_say_s, elapsed_s = now_s + SAY_S, now_s - began_s
            say(
                f"  {done}/{len(environments)} environments, {len(rows)} attempts,"
                f" {_first_rates(rows)}; {60 * simulated / elapsed_s:.0f} reaches a minute,"
                f" {elapsed_s * (len(environments) - done) / done:.0f} s left; kept in"
                f" {library.path}"
            )

    with library.locked():
        known: defaultdict[int, list[ReachRecord]] = defaultdict(list)
        for record in library.records() if library.shard_paths() else []:
            known[record.environment].append(record)
        tasks = (
            Task(shard_name(evaluation.stream, i), (plan, i, known.pop(i, [])))
            for i in environments
        )
        failed = run_tasks(tasks, _try_environment, workers or Workers(), finish, report)
        refuse_failed(failed)
        library.compact()
    rows.sort(key=lambda row: (row.method, row.environment, row.goal, row.attempt))
    others = read_trials(evaluation.trials_path) if evaluation.trials_path.exists() else []
    replaced = {(evaluation.variant, method) for method in evaluation.methods}
    kept = [row for row in others if (row.variant, row.method) not in replaced]
    write_trials(evaluation.trials_path, [*kept, *rows])
    return rows


def _first_rates(rows: Sequence[TrialRow]) -> str:
    """Formats each strategy's success rate of first attempts so far."""
    parts = []
    for method in sorted({row.method for row in rows}):
        won = [row.success for row in rows if row.method == method and row.attempt == 1]
        parts.append(f"{method} {100 * np.mean(won):.0f} %")
    return ", ".join(parts)


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """What workers need; plans are compared by name, which is unique for each run."""

    name: str
    evaluation: Evaluation = field(compare=False)
    scenario: Scenario = field(compare=False)
    cameras: CamerasConfig | None = field(compare=False)


class _Strategies:
    """The strategies of an evaluation, each fitted on first use."""

    def __init__(self, plan: _Plan) -> None:
        self._plan = plan
        self._columns = ExperienceLibrary(plan.evaluation.experience).columns()
        self._pairs = None
        if plan.evaluation.second_attempts is not None:
            attempts = ExperienceLibrary(plan.evaluation.second_attempts)
            self._pairs = pair_second_attempts(attempts.columns())
        self._fitted: dict[str, Selector] = {}

    def selector(self, method: str, environment: int, goal: int) -> Selector:
        """Returns the strategy for a trial."""
        parts = check_method(method)
        if len(parts) > 1:
            first, later = (self.selector(part, environment, goal) for part in parts)
            return FallbackSelector(first=first, later=later, method=method)
        if method == "rnd":
            # A generator for each trial, independent of all others.
            rng = make_generator(self._plan.evaluation.stream, "rnd", environment, goal)
            return RandomSelector(rng=rng)
        if method not in self._fitted:
            self._fitted[method] = make_selector(
                method,
                self._plan.scenario.arm(),
                self._columns if needs_library(method) else None,
                category=self._plan.scenario.category,
                pairs=self._pairs,
            )
        return self._fitted[method]


_strategies = lru_cache(maxsize=1)(_Strategies)
"""Workers reuse the strategies of an evaluation between environments."""


def _try_environment(
    plan: _Plan, environment: int, known: list[ReachRecord]
) -> tuple[list[TrialRow], list[ReachRecord]]:
    """Runs in a worker: returns all trials in an environment, and its new reaches."""
    records = {record.key: record for record in known}
    new: list[ReachRecord] = []

    def reach(request: ReachRequest) -> ReachRecord:
        if request.key not in records:
            records[request.key] = run_reach(request)
            new.append(records[request.key])
        return records[request.key]

    evaluation, strategies, rows = plan.evaluation, _strategies(plan), list[TrialRow]()
    for goal in range(evaluation.goals):
        at = evaluation.first_environment if evaluation.common_goals else environment
        p_WG = plan.scenario.sample_goal(evaluation.stream, at, goal)
        observer = None  # All strategies see the same images.
        if plan.cameras is not None:
            observer = Observer(
                scenario=plan.scenario,
                stream=evaluation.stream,
                environment=environment,
                p_WG=p_WG,
                cameras=plan.cameras,
                moves=evaluation.moves,
            )
        for method in evaluation.methods:
            attempts = run_trial(
                plan.scenario,
                strategies.selector(method, environment, goal),
                evaluation.stream,
                environment,
                p_WG,
                evaluation.attempts,
                fresh=evaluation.fresh,
                moves=evaluation.moves,
                reach=reach,
                look=observer,
            )
            last = attempts[-1].record
            won = last.success if observer is None else observer.touches_ball(last)
            for number, attempt in enumerate(attempts, start=1):
                probability = attempt.selection.probability
                rows.append(
                    TrialRow(
                        variant=evaluation.variant,
                        method=method,
                        environment=environment,
                        goal=goal,
                        attempt=number,
                        key=attempt.request.key,
                        # All attempts but the last one failed.
                        success=won and number == len(attempts),
                        probability=float("nan") if probability is None else probability,
                        seconds=attempt.selection.seconds,
                    )
                )
        if observer is not None:
            # A renderer takes 150 MB in a reference cycle, which only the collector frees.
            del observer
            gc.collect()
    return rows, new
