"""Trials (paper VI-A), and evaluations of several strategies by trials at the same goals."""

import gc
import math
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from lic_drake.errors import LibraryError, RequestError, remark
from lic_drake.evaluate.trials import TrialRow, read_trials, write_trials
from lic_drake.experience.runner import Task, refuse_failed, run_tasks, shard_name
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.perception.config import CamerasConfig, load_cameras
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
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
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.starts import FeasibleStarts, make_starts
from lic_drake.types import Vector

MOST = 1_000_000
"""Largest number of environments."""

SAY_S = 5.0
"""Time between two progress messages, seconds."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A selection and the reach from it."""

    selection: Selection
    request: ReachRequest
    record: ReachRecord


def run_trial(
    scenario: Scenario,
    selector: Selector,
    stream: str,
    environment: int,
    p_WG: Vector,
    attempts: int,
    *,
    moves: bool = True,
    reach: Callable[[ReachRequest], ReachRecord] = run_reach,
    look: Callable[[int], tuple[Vector, FeasibleStarts]] | None = None,
) -> list[Attempt]:
    """Selects and reaches until the goal is reached or the attempts are used up.

    The goal p_WG has the shape (3,), metres. An attempt finds the environment as the previous one
    left it, as on a real robot. `moves` says whether a PR2 may move base and torso before a reach,
    and `reach` simulates a request. `look` returns the perceived goal and the starts believed
    feasible before the attempt with a number, from 0; both are known by default. If the perceived
    goal has changed, the environment is reset.
    """
    if look is None:
        known = make_starts(scenario, scenario.sample_instance(stream, environment), moves)

        def look(_: int) -> tuple[Vector, FeasibleStarts]:
            return p_WG, known

    done: list[Attempt] = []
    for number in range(attempts):
        p_seen, starts = look(number)
        failed = tuple(FailedReach.from_record(last.record, last.request) for last in done)
        selection = selector.select(Situation(p_WG=p_seen, starts=starts, failed=failed))
        if done and np.array_equal(p_seen, done[-1].request.goal):
            request = done[-1].request.then(selection.start)
        else:
            request = ReachRequest(scenario, stream, environment, p_seen, selection.start)
        done.append(Attempt(selection=selection, request=request, record=reach(request)))
        if done[-1].record.success:
            break
    return done


def random_requests(
    scenario: Scenario, stream: str, environments: int, goals: int
) -> list[ReachRequest]:
    """Returns reaches from random starts of the grid to random goals: RND's first attempts.

    There are `goals` reaches in each environment, to as many goals unless it has a single one.
    """
    requests = []
    for environment in range(environments):
        instance = scenario.sample_instance(stream, environment)
        starts = make_starts(scenario, instance).grid.without_q()
        if not len(starts):
            raise RequestError(f"no discrete start is feasible in environment {environment}")
        for goal in range(goals):
            index = 0 if scenario.task.goal_area is None else goal
            p_WG = scenario.sample_goal(stream, environment, index)
            rng = make_generator(stream, "rnd", environment, goal)
            start = starts[int(rng.integers(len(starts)))]
            requests.append(ReachRequest(scenario, stream, environment, p_WG, start))
    return requests


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """The parameters of an evaluation; plain data that can be pickled.

    Environments and goals are drawn from a seed stream; `moves` says whether an arm in space may
    move its base and torso. With cameras, a reach succeeds if it ends in the ball.

    Attributes:
        experience: Library that the strategies learn from; its scenario is the default.
        results: Folder for `trials.parquet` and the library `reaches`.
        methods: Strategies, see `lic_drake.select.registry.check_method`.
        variant: Name of these trials among others in the same folder.
        overrides: YAML text merged into the scenario, for instance to block apertures.
        scenario_name: Name or path of a scenario other than the library's.
        cameras: Name or path of those that perceive apertures and goal; empty: both are known.
    """

    experience: Path
    results: Path
    methods: tuple[str, ...]
    environments: int
    goals: int
    first: int = 0
    attempts: int = 2
    stream: str = "evaluation"
    variant: str = ""
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
        """Returns the evaluated scenario."""
        if self.scenario_name:
            return load_scenario(self.scenario_name, self.overrides)
        return ExperienceLibrary(self.experience).scenario(self.overrides)


def run_evaluation(
    evaluation: Evaluation,
    workers: Workers | None = None,
    say: Callable[[str], None] = print,
    is_over: Callable[[], bool] | None = None,
) -> list[TrialRow]:
    """Runs every strategy on the same goals in the same environments.

    Stored reaches are reused; selections are always recomputed. The file of trials also keeps those
    of other variants and strategies. `say` receives progress messages. When `is_over`, no further
    environment is begun but the first: `environments` are then as many as there may be.

    Raises:
        LicError: A method is unknown, a library cannot be read or written, or an environment
            failed; reaches of finished environments are kept.
    """
    _check(evaluation)
    scenario = evaluation.scenario()
    library = evaluation.reaches
    library.create()
    library.check_scenario(scenario, "the evaluation")
    elsewhere = replace(  # Workers may run in other folders.
        evaluation,
        experience=evaluation.experience.absolute(),
    )
    cameras = load_cameras(evaluation.cameras) if evaluation.cameras else None
    shared = (uuid4().hex, elsewhere, scenario, cameras)
    began_s = said_s = time.perf_counter()
    count, done = evaluation.environments, 0
    rows: list[TrialRow] = []

    def finish(task: Task, result: tuple[list[TrialRow], list[ReachRecord]]) -> None:
        nonlocal said_s, done
        new_rows, records = result
        if records:
            library.add_to_shard(task.name, records, scenario)
        rows.extend(new_rows)
        done += 1
        now_s = time.perf_counter()
        if now_s >= said_s + SAY_S or done == count:
            said_s, left_s = now_s, (now_s - began_s) * (count - done) / done
            of, left = ("", "") if is_over else (f"/{count}", f", {left_s:.0f} s left")
            tried = f"{len(rows)} attempts, {sum(row.success for row in rows)} reached"
            say(f"  {done}{of} environments, {tried}{left}; kept in {library.path}")

    with library.locked():
        others = read_trials(evaluation.trials_path) if evaluation.trials_path.exists() else []
        known: defaultdict[int, list[ReachRecord]] = defaultdict(list)
        for record in library.records() if library.shard_paths() else []:
            known[record.environment].append(record)
        tasks = (
            Task(shard_name(evaluation.stream, i), (*shared, i, known.pop(i, [])))
            for i in range(evaluation.first, evaluation.first + count)
            if i == evaluation.first or is_over is None or not is_over()
        )
        refuse_failed(run_tasks(tasks, _try_environment, workers or Workers(), finish))
        library.compact()
    rows.sort(key=lambda row: (row.method, row.environment, row.goal, row.attempt))
    replaced = {(evaluation.variant, method) for method in evaluation.methods}
    kept = [row for row in others if (row.variant, row.method) not in replaced]
    write_trials(evaluation.trials_path, [*kept, *rows])
    return rows


def _check(evaluation: Evaluation) -> None:
    """Raises a LicError for an evaluation that cannot be."""
    methods, results = evaluation.methods, ExperienceLibrary(evaluation.results)
    for method in methods:
        check_method(method)
        if methods.count(method) > 1:
            raise RequestError(f"method {method} is there {methods.count(method)} times; keep one")
    if not 1 <= evaluation.environments <= MOST:
        raise RequestError(f"environments must be from 1 to {MOST}, got {evaluation.environments}")
    for name in ("goals", "attempts"):
        if (value := getattr(evaluation, name)) < 1:
            raise RequestError(f"{name} must be at least 1, got {value}")
    held = results.shard_paths() if results.path.is_dir() else []
    if set(held) - {evaluation.trials_path}:
        raise LibraryError(
            f"{results.path} is a library itself; evaluate into another folder, such as"
            f" {results.path / 'choices'}"
        )
    if any(map(needs_library, methods)):
        learned = ExperienceLibrary(evaluation.experience).scenario()
        if learned.arm().digest != evaluation.scenario().arm().digest:
            raise LibraryError(
                f"{evaluation.experience} is for {learned.arm().name}, but"
                f" {evaluation.scenario().arm().name} is evaluated; choose another library"
            )


class _Strategies:
    """The strategies of an evaluation, each fitted on first use."""

    def __init__(self, evaluation: Evaluation, scenario: Scenario) -> None:
        self._stream = evaluation.stream
        learns = any(needs_library(method) for method in evaluation.methods)
        columns = ExperienceLibrary(evaluation.experience).columns() if learns else None
        self._fitted: Callable[[str], Selector] = cache(
            partial(make_selector, columns=columns, say=remark)
        )

    def selector(self, method: str, environment: int, goal: int) -> Selector:
        """Returns the strategy for a trial."""
        parts = check_method(method)
        if len(parts) > 1:
            first, later = (self.selector(part, environment, goal) for part in parts)
            return FallbackSelector(first=first, later=later, method=method)
        if method == "rnd":
            # A generator for each trial, independent of all others.
            rng = make_generator(self._stream, "rnd", environment, goal)
            return RandomSelector(rng=rng)
        return self._fitted(method)


# Those of the last evaluation, by its unique name: workers reuse them between environments.
_strategies: dict[str, _Strategies] = {}


def _try_environment(
    name: str,
    evaluation: Evaluation,
    scenario: Scenario,
    cameras: CamerasConfig | None,
    environment: int,
    known: list[ReachRecord],
) -> tuple[list[TrialRow], list[ReachRecord]]:
    """Runs in a worker: returns all trials in an environment, and its new reaches."""
    if name not in _strategies:
        _strategies.clear()
        _strategies[name] = _Strategies(evaluation, scenario)
    records = {record.key: record for record in known}
    new: list[ReachRecord] = []

    def reach(request: ReachRequest) -> ReachRecord:
        if request.key not in records:
            records[request.key] = run_reach(request)
            new.append(records[request.key])
        return records[request.key]

    rows: list[TrialRow] = []
    for goal in range(evaluation.goals):
        p_WG = scenario.sample_goal(evaluation.stream, environment, goal)
        place: dict[str, Any] = {
            "scenario": scenario,
            "stream": evaluation.stream,
            "environment": environment,
            "p_WG": p_WG,
            "moves": evaluation.moves,
        }
        # All strategies see the same images.
        observer = None if cameras is None else Observer(cameras=cameras, **place)
        for method in evaluation.methods:
            attempts = run_trial(
                selector=_strategies[name].selector(method, environment, goal),
                attempts=evaluation.attempts,
                reach=reach,
                look=observer,
                **place,
            )
            last = attempts[-1].record
            won = last.success if observer is None else observer.touches_ball(last)
            for number, attempt in enumerate(attempts, start=1):
                selection = attempt.selection
                row = TrialRow(
                    variant=evaluation.variant,
                    method=method,
                    environment=environment,
                    goal=goal,
                    attempt=number,
                    key=attempt.request.key,
                    success=won and number == len(attempts),  # All others failed.
                    probability=math.nan
                    if selection.probability is None
                    else selection.probability,
                    seconds=selection.seconds,
                )
                rows.append(row)
        if observer is not None:
            # A renderer takes 150 MB in a reference cycle, which only the collector frees.
            del observer
            gc.collect()
    return rows, new
