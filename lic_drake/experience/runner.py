"""`simulate`: simulates the requests that a library lacks; one environment is one task, one shard.

A shard is written as a whole by this process when its task has ended. What Ctrl-C, a full disk or
a kill may cost is therefore the environments under way; to resume is to ask for the same requests.
"""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sized
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, wait
from dataclasses import dataclass, field
from itertools import groupby
from types import MappingProxyType
from typing import Any

import lic_drake
from lic_drake.errors import ClusterError, LibraryError, LicError
from lic_drake.experience.schema import read_shard, to_records
from lic_drake.experience.store import WHOLE, ExperienceLibrary, Share
from lic_drake.experience.workers import ThisProcess, Workers
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach

ReachFunction = Callable[[ReachRequest], ReachRecord]
"""Simulates a request; a top-level function, so that worker processes can import it."""

POLL_S = 0.5
"""Time between two reports of progress, seconds."""

TRIES = 3
"""A task during which a worker died so many times is given up, the last time on its own."""


@dataclass(frozen=True)
class Task:
    """A call to make in a worker: its name, for instance that of its shard, and its arguments."""

    name: str
    arguments: tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class Progress:
    """A run at one moment, or at its end.

    Attributes:
        total: Number of reaches that were asked for.
        present: How many of them were in the library before this run.
        done: How many are there now.
        successes: How many of those reached their goal.
        at_work: Number of environments that are being simulated.
        elapsed_s: Wall time of this run, seconds.
        failed: Names of the environments that were left out at the end, and why, in a line.
    """

    total: int
    present: int
    done: int
    successes: int
    at_work: int
    elapsed_s: float
    failed: Mapping[str, str]

    @property
    def reaches_per_minute(self) -> float:
        """Rate of this run; 0 before its first shard."""
        return 60.0 * (self.done - self.present) / self.elapsed_s if self.elapsed_s > 0 else 0.0

    def describe(self) -> str:
        """Returns one line for people."""
        rate, clock = self.reaches_per_minute, "?"
        if rate > 0:
            left_min = int((self.total - self.done) / rate)
            clock = f"{left_min // 60}:{left_min % 60:02d} h"
        return (
            f"{self.done}/{self.total} reaches, {self.successes} successes, {rate:.0f} reaches/min"
            f" in {self.at_work} environments, {clock} left"
        )


ProgressFunction = Callable[[Progress], None]
"""Is called about twice a second during a run, and at its end."""


def refuse_failed(failed: Mapping[str, str]) -> None:
    """Raises a `LibraryError` if tasks were left out; takes names and reasons."""
    for name, reason in failed.items():
        raise LibraryError(
            f"{len(failed)} environments failed, for instance {name}: {reason}; run it again to"
            " try them again"
        )


def simulate(
    requests: Iterable[ReachRequest],
    library: ExperienceLibrary,
    workers: Workers | None = None,
    *,
    total: int | None = None,
    share: Share = WHOLE,
    reach: ReachFunction = run_reach,
    progress: ProgressFunction = lambda progress: None,
) -> Progress:
    """Simulates the requests that are not yet in a library.

    The library does not depend on workers or interruptions (but for wall times).

    Args:
        requests: What to simulate, environment by environment; all of one scenario. They may be
            generated on the way.
        library: A folder; made if absent.
        workers: Where to simulate; by default in this process.
        total: Number of requests, for the progress; by default their length, if they have one.
        share: Which share of a divided collection this is; others of the same division may be at
            work on the same library, on other environments.
        reach: Simulates one of them.
        progress: Shows how far the run is.

    Returns:
        The state at the end.

    Raises:
        LibraryError: The library is in use, holds a damaged file or another scenario, or cannot
            be written; shards that were finished are kept.
        ClusterError: The cluster cannot be used; as above.
        KeyboardInterrupt: On Ctrl-C; as above.
    """
    library.create()
    with library.locked(share):
        run = _Run(library, total or (len(requests) if isinstance(requests, Sized) else 0))
        failed = run_tasks(
            run.tasks(requests, reach),
            simulate_environment,
            workers or ThisProcess(),
            run.finish,
            lambda at_work: progress(run.progress(at_work)),
        )
        return run.progress(at_work=0, failed=failed)


def simulate_environment(reach: ReachFunction, requests: list[ReachRequest]) -> list[ReachRecord]:
    """Runs in a worker: simulates the reaches into one environment."""
    return [reach(request) for request in requests]


@dataclass
class _Run:
    """What is there and what has come."""

    library: ExperienceLibrary
    total: int
    present: int = 0
    done: int = 0
    successes: int = 0
    began_s: float = field(default_factory=time.monotonic)

    def tasks(self, requests: Iterable[ReachRequest], reach: ReachFunction) -> Iterator[Task]:
        """Yields a task for each environment that lacks reaches."""
        held = self.library.successes()
        known = set(held)
        for environment, group in groupby(requests, lambda r: (r.stream, r.environment)):
            lacking: list[ReachRequest] = []
            for request in group:
                key = request.key
                if key in held:
                    self.present += 1
                    self.done += 1
                    self.successes += held[key]
                elif key not in known:
                    lacking.append(request)
                known.add(key)
            if lacking:
                yield Task(shard_name(*environment), (reach, lacking))

    def finish(self, task: Task, records: list[ReachRecord]) -> None:
        """Writes the shard of a task."""
        requests: list[ReachRequest] = task.arguments[1]
        versions = {record.lic_drake_version for record in records}
        if [r.key for r in records] != [r.key for r in requests] or versions != {
            lic_drake.__version__
        }:
            raise ClusterError(
                f"a worker simulated other reaches than those of {task.name}, with lic_drake"
                f" {', '.join(sorted(versions))}; install lic_drake {lic_drake.__version__} and the"
                " same extensions on all workers"
            )
        add_to_shard(self.library, task.name, records, requests[0].scenario)
        self.done += len(records)
        self.successes += sum(record.success for record in records)

    def progress(self, at_work: int, failed: Mapping[str, str] = MappingProxyType({})) -> Progress:
        """Returns the present state."""
        return Progress(
            total=max(self.total, self.done),
            present=self.present,
            done=self.done,
            successes=self.successes,
            at_work=at_work,
            elapsed_s=time.monotonic() - self.began_s,
            failed=failed,
        )


def shard_name(stream: str, environment: int) -> str:
    """Returns the name of an environment's shard."""
    return f"{stream}-{environment:06d}"


def add_to_shard(
    library: ExperienceLibrary, name: str, records: list[ReachRecord], scenario: Scenario
) -> None:
    """Writes a shard anew with more records.

    Raises:
        LibraryError: The old shard is damaged, or the system refuses.
    """
    path = library.shard_path(name)
    old = to_records(read_shard(path)[1]) if path.exists() else []
    keys = {record.key for record in old}
    new = [record for record in records if record.key not in keys]
    library.write_shard(name, [*old, *new], scenario)


def run_tasks[R](
    tasks: Iterable[Task],
    work: Callable[..., R],
    workers: Workers,
    finish: Callable[[Task, R], None],
    report: Callable[[int], None] = lambda at_work: None,
) -> dict[str, str]:
    """Calls `work` with each task's arguments in workers, and `finish` here as the calls end.

    A call during which a worker process died is repeated: whoever was at work then, since it is
    not known whose worker it was; the third time a task runs alone. What raises is left out.

    Args:
        tasks: What to call; taken one by one as workers become free.
        work: A top-level function.
        workers: Where to call it.
        finish: Takes a task and the result.
        report: Is called with the number of running calls about twice a second.

    Returns:
        Names of the tasks that were left out, and why, in a line.

    Raises:
        LicError: `finish` or `work` raised it; no other task would fare better.
    """
    new, again = iter(tasks), deque[Task]()
    running: dict[Future[R], Task] = {}
    deaths: Counter[str] = Counter()
    failed: dict[str, str] = {}

    def take() -> Task | None:
        if any(deaths[task.name] == TRIES - 1 for task in running.values()):
            return None  # That one is alone.
        task = next(new, None)
        if task is None and again and (deaths[again[0].name] < TRIES - 1 or not running):
            return again.popleft()
        return task

    def conclude(future: Future[R]) -> bool:
        """Takes a result; returns whether a worker died."""
        task = running.pop(future)
        try:
            finish(task, future.result())
        except BrokenExecutor:
            deaths[task.name] += 1
            if deaths[task.name] < TRIES:
                again.append(task)
            else:
                failed[task.name] = f"its worker process died {TRIES} times"
            return True
        except LicError:
            raise
        except Exception as error:
            failed[task.name] = " ".join(f"{type(error).__name__}: {error}".split())
        return False

    waiting = take()
    try:
        while running or waiting is not None:
            while waiting is not None and len(running) < workers.capacity():
                running[workers.submit(work, *waiting.arguments)] = waiting
                waiting = take()
            if not running:
                time.sleep(POLL_S)  # There are no workers yet.
            done = wait(running, POLL_S, FIRST_COMPLETED).done
            if any([conclude(future) for future in done]):
                for future in wait(running).done:
                    conclude(future)
                workers.restart()
            waiting = waiting or take()
            report(len(running))
    except (LibraryError, ClusterError) as error:
        raise type(error)(
            f"{error}; finished environments are kept, run the same command to go on"
        ) from error
    finally:
        for future in running:
            future.cancel()
    return failed
