"""Trials of several strategies on the same unseen environments, in parallel and resumable."""

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from lic_drake.errors import LibraryError, LicError
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.evaluate.trials import TrialRow, read_trials, write_trials
from lic_drake.experience.added import added_columns
from lic_drake.experience.real_pairs import pair_real_attempts
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import prepare_worker
from lic_drake.perception.config import load_cameras
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario, load_scenario, parse_scenario
from lic_drake.seeds import make_generator
from lic_drake.select.baselines import RandomSelector
from lic_drake.select.registry import (
    FallbackSelector,
    Selector,
    check_method,
    make_selector,
    needs_library,
    split_method,
)
from lic_drake.types import Vector

REACHES_A_BLOCK = 60
"""About this many reaches make a unit of work: what an interruption can cost each worker."""


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What is to be tried; plain data that pickles.

    Attributes:
        experience: Library that the strategies learn from; it says the scenario.
        results: Folder for `trials.parquet` and the library `reaches` of the evaluation's reaches.
        methods: Strategies, see `lic_drake.select.registry.check_method`.
        environments: Number of environments, from index `first_environment`.
        goals: Number of random goals in each.
        attempts: How many attempts at a goal at the most.
        stream: Seed stream of environments and goals.
        first_environment: Index of the first environment.
        fresh: Whether later attempts find the environment as it was drawn.
        variant: Name for these trials among others in the same folder.
        common_goals: Whether all environments have the goals of the first one.
        second_attempts: Library of real second attempts that LIC-2 learns from; None: D2 is made
            from single reaches, as in the paper.
        overrides: YAML text put over the library's scenario: what is tried may differ from what
            was learned from, for instance by apertures that are blocked.
        moves: Whether a PR2 may move base and torso before a reach.
        scenario_name: Scenario that is tried where it is not the library's, a name or a path: what
            was learned in one kind of clutter is used in another.
        cameras: Cameras that have to find apertures and goal, see
            `lic_drake.perception.config.load_cameras`; none: both are known. A reach is then a
            success if it ends in the ball.
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
        """File with a row for each attempt."""
        return self.results / "trials.parquet"

    @property
    def reaches(self) -> ExperienceLibrary:
        """The reaches of all attempts."""
        return ExperienceLibrary(self.results / "reaches")

    def scenario(self) -> Scenario:
        """Returns the scenario that is tried.

        Raises:
            LicError: The library cannot be read, or an override does not fit.
        """
        if self.scenario_name:
            return load_scenario(self.scenario_name, self.overrides)
        scenario = ExperienceLibrary(self.experience).scenario()
        if not self.overrides:
            return scenario
        return parse_scenario(scenario_text(scenario), self.overrides, source="--set")


def run_evaluation(
    evaluation: Evaluation, workers: int = 1, say: Callable[[str], None] = print
) -> list[TrialRow]:
    """Runs every strategy on the same goals in the same environments.

    Reaches are kept and not simulated again; selections are made anew, so that the trials always
    are those of the present strategies and libraries.

    Args:
        evaluation: What is to be tried.
        workers: Number of processes.
        say: Gets a line now and then.

    Returns:
        The rows of these trials; the file keeps those of other variants and strategies, too.

    Raises:
        LicError: A method is unknown, or a library cannot be read or written.
    """
    for method in evaluation.methods:
        check_method(method)
    scenario = evaluation.scenario()
    library = evaluation.reaches
    library.create()
    if library.shard_paths() and library.header().scenario_digest != scenario.digest:
        raise LibraryError(
            f"{library.path} holds reaches of another scenario than the one to be tried"
            f" ({evaluation.scenario_name or evaluation.experience},"
            f" {evaluation.overrides or 'as it is'}); choose another"
            " folder for the results"
        )
    blocks = _blocks(evaluation)
    # Threads of linear algebra in this process would be inherited by nobody and help nobody.
    executor = ProcessPoolExecutor(
        workers,
        mp_context=get_context("forkserver"),
        initializer=_begin_worker,
        initargs=(evaluation,),
    )
    began = time.perf_counter()
    rows: list[TrialRow] = []
    done = simulated = 0
    try:
        for future in as_completed([executor.submit(_run_block, block) for block in blocks]):
            new_rows, new_records = future.result()
            if new_records:
                library.write_shard(f"new-{new_records[0].key}", new_records, scenario)
            rows += new_rows
            done += 1
            simulated += len(new_records)
            elapsed = time.perf_counter() - began
            say(
                f"  {done}/{len(blocks)} blocks, {len(rows)} attempts, {_first_rates(rows)};"
                f" {60 * simulated / elapsed:.0f} reaches a minute,"
                f" {elapsed * (len(blocks) - done) / done:.0f} s left; kept in {library.path}"
            )
    finally:
        executor.shutdown(cancel_futures=True)
    library.compact()
    rows.sort(key=lambda row: (row.method, row.environment, row.goal, row.attempt))
    others = read_trials(evaluation.trials_path) if evaluation.trials_path.exists() else []
    write_trials(evaluation.trials_path, [*(o for o in others if not _is_of(o, evaluation)), *rows])
    return rows


def _is_of(row: TrialRow, evaluation: Evaluation) -> bool:
    return row.variant == evaluation.variant and row.method in evaluation.methods


def _first_rates(rows: Sequence[TrialRow]) -> str:
    """Returns the success rate of first attempts of each strategy so far."""
    parts = []
    for method in sorted({row.method for row in rows}):
        won = [row.success for row in rows if row.method == method and row.attempt == 1]
        parts.append(f"{method} {100 * np.mean(won):.0f} %")
    return ", ".join(parts)


def _blocks(evaluation: Evaluation) -> list[range]:
    """Returns the environments in units of work."""
    each = evaluation.goals * len(evaluation.methods) * 1.5
    size = max(1, round(REACHES_A_BLOCK / each))
    first, last = evaluation.first_environment, evaluation.first_environment
    last += evaluation.environments
    return [range(i, min(i + size, last)) for i in range(first, last, size)]


class _Worker:
    """What a process keeps between blocks: fitted strategies and the reaches known so far."""

    def __init__(self, evaluation: Evaluation) -> None:
        self._evaluation = evaluation
        experience = ExperienceLibrary(evaluation.experience)
        self.scenario = evaluation.scenario()
        self._columns, self._added = experience.columns(), added_columns(experience)
        self._pairs = None
        if evaluation.second_attempts is not None:
            attempts = ExperienceLibrary(evaluation.second_attempts)
            self._pairs = pair_real_attempts(attempts.columns())
        self._selectors: dict[str, Selector] = {}
        self._cameras = load_cameras(evaluation.cameras) if evaluation.cameras else None
        library = evaluation.reaches
        self._known = {r.key: r for r in library.records()} if library.shard_paths() else {}
        self.new: list[ReachRecord] = []

    def run(self, environments: range) -> Iterator[tuple[str, int, int, list[Attempt], bool]]:
        """Yields method, environment, goal, attempts and success of each trial."""
        evaluation = self._evaluation
        for environment in environments:
            for goal in range(evaluation.goals):
                at = evaluation.first_environment if evaluation.common_goals else environment
                p_WG = self.scenario.sample_goal(evaluation.stream, at, goal)
                observer = self._observer(environment, p_WG)
                for method in evaluation.methods:
                    attempts = run_trial(
                        self.scenario,
                        self._selector(method, environment, goal),
                        evaluation.stream,
                        environment,
                        p_WG,
                        evaluation.attempts,
                        fresh=evaluation.fresh,
                        moves=evaluation.moves,
                        reach=self._reach,
                        look=observer,
                    )
                    last = attempts[-1].record
                    won = last.success if observer is None else observer.touches_ball(last)
                    yield method, environment, goal, attempts, won
                if observer is not None:
                    # A renderer takes 150 MB, and its diagram is a reference cycle: only the
                    # collector frees it.
                    del observer
                    gc.collect()

    def _observer(self, environment: int, p_WG: Vector) -> Observer | None:
        """Returns the observer of an environment; all strategies see the same images."""
        if self._cameras is None:
            return None
        return Observer(
            scenario=self.scenario,
            stream=self._evaluation.stream,
            environment=environment,
            p_WG=p_WG,
            cameras=self._cameras,
            moves=self._evaluation.moves,
        )

    def _selector(self, method: str, environment: int, goal: int) -> Selector:
        first, later = split_method(method)
        if later is not None:
            return FallbackSelector(
                first=self._selector(first, environment, goal),
                later=self._selector(later, environment, goal),
                method=method,
            )
        if method == "rnd":
            # Draws of its own for every trial: independent of how many others there are.
            rng = make_generator(self._evaluation.stream, "rnd", environment, goal)
            return RandomSelector(rng=rng)
        if method not in self._selectors:
            self._selectors[method] = make_selector(
                method,
                self.scenario.arm(),
                self._columns if needs_library(method) else None,
                category=self.scenario.category,
                pairs=self._pairs,
                added=self._added,
            )
        return self._selectors[method]

    def _reach(self, request: ReachRequest) -> ReachRecord:
        if request.key not in self._known:
            self._known[request.key] = run_reach(request)
            self.new.append(self._known[request.key])
        return self._known[request.key]


_worker: _Worker | LicError | None = None


def _begin_worker(evaluation: Evaluation) -> None:
    global _worker
    prepare_worker()
    try:
        _worker = _Worker(evaluation)
    except LicError as error:  # An executor would only say that its worker broke.
        _worker = error


def _run_block(environments: range) -> tuple[list[TrialRow], list[ReachRecord]]:
    if not isinstance(_worker, _Worker):
        raise _worker or LicError("the worker was not prepared")
    _worker.new = []
    rows = [
        TrialRow(
            variant=_worker._evaluation.variant,
            method=method,
            environment=environment,
            goal=goal,
            attempt=number,
            key=attempt.request.key,
            # An attempt before the last one failed.
            success=won and number == len(attempts),
            probability=float("nan")
            if attempt.selection.probability is None
            else attempt.selection.probability,
            seconds=attempt.selection.seconds,
        )
        for method, environment, goal, attempts, won in _worker.run(environments)
        for number, attempt in enumerate(attempts, start=1)
    ]
    return rows, _worker.new
