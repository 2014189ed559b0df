"""`simulate`: simulates the requests that a library lacks; each environment is a task and a shard.

This process writes each shard atomically once its task has finished, so Ctrl-C, a full disk or a
kill loses only the environments in progress. Running the same requests again resumes.
"""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import lic_drake
from lic_drake.errors import ClusterError, LibraryError, LicError, PerceptionError, RequestError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

ReachFunction = Callable[[ReachRequest], ReachRecord]
"""Simulates a request; a top-level function, so that worker processes can import it."""

POLL_S = 0.5
"""Interval between progress reports, seconds."""

TRIES = 3
"""A task is abandoned when workers died during this many runs of it; the last one is solitary."""


@dataclass(frozen=True)
class Task:
    """The arguments of a call in a worker, with a unique name such as that of its shard."""

    name: str
    arguments: tuple[Any, ...]


@dataclass(kw_only=True)
class Progress:
    """State of a run, which updates it.

    Attributes:
        total: Number of requested reaches, of which the library held `present` before this run
            and holds `done` now, among them so many `successes`.
        at_work: Number of environments in progress.
        failed: Environments that were abandoned, by name, with the reason in one line.
    """

    total: int
    present: int = 0
    done: int = 0
    successes: int = 0
    at_work: int = 0
    elapsed_s: float = 0.0
    failed: Mapping[str, str] = field(default_factory=dict)

    def describe(self) -> str:
        """Returns a one-line progress message."""
        rate = 60.0 * (self.done - self.present) / self.elapsed_s if self.elapsed_s > 0 else 0.0
        left_min = int((self.total - self.done) / rate) if rate > 0 else 0
        left = f"{left_min // 60}:{left_min % 60:02d} h" if rate > 0 else "?"
        return (
            f"{self.done}/{self.total} reaches, {self.successes} successes, {rate:.0f} reaches/min"
            f" in {self.at_work} environments, {left} left"
        )


def refuse_failed(failed: Mapping[str, str]) -> None:
    """Raises a `LibraryError` if tasks failed; takes their names and reasons."""
    for name, reason in failed.items():
        raise LibraryError(
            f"{len(failed)} environments failed, for instance {name}: {reason}; run the same"
            " command to retry them"
        )


def simulate(
    requests: Iterable[ReachRequest],
    library: ExperienceLibrary,
    workers: Workers | None = None,
    *,
    total: int = 0,
    reach: ReachFunction = run_reach,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Simulates the requests that a library lacks, and returns the final state.

    The library is locked meanwhile. Apart from wall times, the result depends neither on the
    workers nor on interruptions. Finished shards are kept whatever is raised.

    Args:
        requests: Requests of one scenario, grouped by environment.
        library: A folder; created if absent.
        workers: Where to simulate; by default in this process.
        total: Number of requests, for the progress.
        reach: Simulates a request.
        progress: Called about twice a second.

    Raises:
        LibraryError: The library is in use, damaged, of another scenario, or not writable.
        ClusterError: The cluster cannot be used.
    """
    library.create()
    with library.locked():
        return simulate_locked(
            requests, library, workers, total=total, reach=reach, progress=progress
        )


def simulate_locked(
    requests: Iterable[ReachRequest],
    library: ExperienceLibrary,
    workers: Workers | None = None,
    *,
    total: int = 0,
    reach: ReachFunction = run_reach,
    progress: Callable[[Progress], None] = lambda progress: None,
) -> Progress:
    """Does the same in a library whose lock the caller holds, see `ExperienceLibrary.locked`."""
    state = Progress(total=total)
    began_s = time.monotonic()

    def report(at_work: int) -> None:
        state.at_work, state.elapsed_s = at_work, time.monotonic() - began_s
        progress(state)

    def tasks() -> Iterator[Task]:
        """Yields a task for each incomplete environment."""
        held = library.successes()
        for environment, group in groupby(requests, lambda r: (r.stream, r.environment)):
            asked = {request.key: request for request in group}
            present = [held[key] for key in asked if key in held]
            state.present += len(present)
            state.done += len(present)
            state.successes += sum(present)
            if lacking := [request for key, request in asked.items() if key not in held]:
                yield Task(shard_name(*environment), (reach, lacking))

    def finish(task: Task, records: list[ReachRecord]) -> None:
        """Writes the shard of a task."""
        asked: list[ReachRequest] = task.arguments[1]
        made = [(record.key, record.lic_drake_version) for record in records]
        if made != [(request.key, lic_drake.__version__) for request in asked]:
            raise ClusterError(
                f"a worker simulated different reaches from those of {task.name}, or has another"
                f" lic_drake; install {lic_drake.__version__} and the same extensions everywhere"
            )
        library.add_to_shard(task.name, records, asked[0].scenario)
        state.done += len(records)
        state.successes += sum(record.success for record in records)

    state.failed = run_tasks(tasks(), simulate_environment, workers or Workers(), finish, report)
    state.at_work, state.elapsed_s = 0, time.monotonic() - began_s
    return state


def simulate_environment(reach: ReachFunction, requests: list[ReachRequest]) -> list[ReachRecord]:
    """Runs in a worker: simulates the reaches in one environment."""
    return [reach(request) for request in requests]


def shard_name(stream: str, environment: int) -> str:
    """Returns the shard name of an environment."""
    return f"{stream}-{environment:06d}"


def run_tasks[R](
    tasks: Iterable[Task],
    work: Callable[..., R],
    workers: Workers,
    finish: Callable[[Task, R], None],
    report: Callable[[int], None] = lambda at_work: None,
) -> dict[str, str]:
    """Calls `work` with each task's arguments in workers, and `finish` with its result here.

    Tasks are drawn one by one as workers become free. When a worker process dies, all running
    calls are repeated, since the executor does not tell which one was responsible; the third run
    of a task is solitary. Tasks that raise are abandoned. `report` receives the number of running
    calls about twice a second.

    Returns:
        The abandoned tasks by name, with the reason in one line.

    Raises:
        LicError: Raised by `finish` or `work`; it would affect all other tasks, too.
    """
    new, again = iter(tasks), deque[Task]()
    running: dict[Future[R], Task] = {}
    deaths: Counter[str] = Counter()
    failed: dict[str, str] = {}

    def take() -> Task | None:
        if any(deaths[task.name] == TRIES - 1 for task in running.values()):
            return None  # Let that one run on its own.
        task = next(new, None)
        if task is None and again and (deaths[again[0].name] < TRIES - 1 or not running):
            return again.popleft()
        return task

    def conclude(future: Future[R]) -> bool:
        """Processes a finished call; returns whether a worker died."""
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
        except (PerceptionError, RequestError) as error:  # Of this environment only.
            failed[task.name] = str(error)
        except LicError:
            raise
        except CancelledError:
            raise ClusterError("lost the connection to the scheduler") from None
        except ImportError as error:
            message = f"a worker failed with: {error}; install the same packages everywhere"
            raise ClusterError(message) from error
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
                time.sleep(POLL_S)  # No workers yet.
            done = wait(running, POLL_S, FIRST_COMPLETED).done
            if any([conclude(future) for future in done]):
                for future in wait(running).done:
                    conclude(future)
                workers.restart()
            waiting = waiting or take()
            report(len(running))
    except (LibraryError, ClusterError) as error:
        raise type(error)(
            f"{error}; finished environments are kept, run the same command to resume"
        ) from error
    finally:
        for future in running:
            future.cancel()
    return failed
