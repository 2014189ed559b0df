"""`collect`: fills a library with the reaches that it still lacks.

An environment is a task, and a task makes one shard.
"""

import time
from collections import defaultdict, deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from lic_drake.errors import ClusterError, LibraryError
from lic_drake.experience.grid import (
    REQUEST_FILE,
    CollectionRequest,
    read_request,
    write_request,
)
from lic_drake.experience.journal import journal_path
from lic_drake.experience.lock import CollectionLock, starting
from lic_drake.experience.progress import Progress, ProgressFunction, Reporter
from lic_drake.experience.schema import read_table
from lic_drake.experience.shard import WHOLE, Shard
from lic_drake.experience.slots import MAX_BREAKS, Slot, TaskState
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.task import ReachFunction, Task, simulate
from lic_drake.experience.workers import make_process_pool

POLL_S = 0.5
"""Wall time between two looks at what is going on, seconds."""


@dataclass(frozen=True, kw_only=True)
class FailedTask:
    """An environment that could not be finished.

    Attributes:
        environment: Its index.
        reason: One line.
    """

    environment: int
    reason: str


@dataclass(frozen=True, kw_only=True)
class CollectionReport:
    """What a collection did.

    Attributes:
        progress: The state at its end.
        failed: Environments that were left out; the library lacks some of their reaches.
    """

    progress: Progress
    failed: tuple[FailedTask, ...]


def collect(
    library: ExperienceLibrary,
    request: CollectionRequest,
    *,
    shard: Shard = WHOLE,
    workers: int | Callable[[], int] = 1,
    make_executor: Callable[[], Executor] = make_process_pool,
    reach: ReachFunction = simulate,
    progress: ProgressFunction | None = None,
) -> CollectionReport:
    """Simulates the reaches of a request that are not yet in a library.

    A finished reach is never lost: not by a killed worker, a full disk, Ctrl-C or the end of this
    process. The library does not depend on the number of workers (but for wall times). A script
    that calls this needs the usual `if __name__ == "__main__":`.

    Args:
        library: A folder; made if absent.
        request: What the library is to hold. A library that was begun before only takes the same
            request, or one with more environments.
        shard: The share of the environments to simulate; collections of other shares of the same
            division may be at work on the same library.
        workers: Number of tasks at work at a time; a function where that changes, as in
            `Cluster.num_workers`.
        make_executor: Makes an executor for one task at a time, for instance
            `Cluster.make_executor`. Its workers must see the library's folder.
        reach: Simulates a request; a top-level function.
        progress: Is called about twice a second.

    Raises:
        LibraryError: The library belongs to another request, holds a damaged file, or cannot be
            written. Workers have stopped, finished reaches are kept.
        ClusterError: The cluster cannot be used; as above.
        KeyboardInterrupt: As on Ctrl-C; workers have stopped, finished reaches are kept.
    """
    library.create()
    slots: list[Slot] = []
    idle: list[Slot] = []
    ended: SimpleQueue[Slot] = SimpleQueue()
    with ExitStack() as stack:
        with starting(library.path):
            lock = stack.enter_context(CollectionLock(library.path, shard))
            _record_request(library, request)
        collection = _Collection(library, request, shard, lock.path, reach)

        def look() -> Progress:
            for slot in slots:
                slot.poll()
            return collection.progress(at_work=len(slots) - len(idle))

        reporter = Reporter(progress, look, POLL_S)
        try:
            while collection.waiting or len(idle) < len(slots):
                allowed = workers() if callable(workers) else workers
                while collection.waiting and len(slots) - len(idle) < allowed:
                    if not idle:
                        slots.append(Slot(make_executor, ended))
                        idle.append(slots[-1])
                    idle[-1].start(collection.waiting.popleft())
                    idle.pop()
                with suppress(Empty):
                    slot = ended.get(timeout=POLL_S)
                    idle.append(slot)
                    collection.conclude(*slot.take())
                reporter.report()
        except (LibraryError, ClusterError) as error:
            raise type(error)(
                f"{error}; finished reaches are kept, run the same command to go on"
            ) from error
        finally:
            lock.stop_workers()
            for slot in slots:
                slot.close()
            idle[:] = slots
            final = reporter.finish()
    return CollectionReport(progress=final, failed=tuple(collection.failed))


class _Collection:
    """The tasks of a collection and what became of them.

    Attributes:
        waiting: Tasks that no slot has begun.
        failed: Tasks that were given up.
    """

    def __init__(
        self,
        library: ExperienceLibrary,
        request: CollectionRequest,
        shard: Shard,
        lock: Path,
        reach: ReachFunction,
    ) -> None:
        self._began = time.monotonic()
        held = _held(library, request.stream)
        digest = request.scenario.digest
        environments = shard.share(request.environment_indices)
        self._total = request.num_reaches(environments)
        self._stored = self._stored_successes = 0
        self._states: list[TaskState] = []
        for environment in environments:
            missing = None
            if environment in held:
                successes = held[environment]
                keys = {item.key for item in request.reaches(environment)}
                missing = frozenset(keys - successes.keys())
                self._stored += len(keys) - len(missing)
                self._stored_successes += sum(successes[key] for key in keys - missing)
            task = Task(
                library=library.path.absolute(),
                lock=lock.absolute(),
                request=request,
                scenario_digest=digest,
                environment=environment,
                missing=missing,
                reach=reach,
            )
            if missing is None or missing:
                self._states.append(TaskState(task))
            else:  # A kill between writing the shard and deleting the journal leaves both.
                journal_path(task.shard).unlink(missing_ok=True)
        self._present = self._stored + sum(state.finished for state in self._states)
        self.waiting = deque(self._states)
        self.failed: list[FailedTask] = []

    def conclude(self, state: TaskState, error: Exception | None) -> None:
        """Decides what becomes of a task that ended, perhaps with an error.

        Raises:
            LibraryError: The task could not write; the others could not either.
            ClusterError: The task has no cluster any more; the others have none either.
        """
        if error is None:
            return
        if isinstance(error, LibraryError | ClusterError):
            raise error
        if isinstance(error, BrokenExecutor):
            if not state.is_deadly():
                self.waiting.append(state)
                return
            reason = f"its worker process died {MAX_BREAKS} times at the same reach"
            if deadly := state.next_reach():
                reason += f", from start {deadly.start} to goal {deadly.goal}"
        else:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
        self.failed.append(FailedTask(environment=state.task.environment, reason=reason))

    def progress(self, at_work: int) -> Progress:
        """Returns the present state, as far as the journals were looked at."""
        return Progress(
            at_work=at_work,
            total=self._total,
            present=self._present,
            done=self._stored + sum(state.finished for state in self._states),
            successes=self._stored_successes + sum(state.successes for state in self._states),
            elapsed_s=time.monotonic() - self._began,
        )


def _record_request(library: ExperienceLibrary, request: CollectionRequest) -> None:
    """Writes the request into the library, unless that was begun with another one."""
    path = library.path / REQUEST_FILE
    if path.exists():
        stored = read_request(path)
        request.refuse_unless_continuing(stored, library.path)
        if stored.environments == request.environments:
            return
    if library.shard_paths() and library.header().scenario_digest != request.scenario.digest:
        raise LibraryError(
            f"{library.path} holds reaches of scenario {library.header().scenario_digest}, not of"
            f" {request.scenario.digest}; use another folder"
        )
    write_request(request, path)


def _held(library: ExperienceLibrary, stream: str) -> dict[int, dict[str, bool]]:
    """Returns environment -> key -> success of all reaches of a stream in a library."""
    held: defaultdict[int, dict[str, bool]] = defaultdict(dict)
    for path in library.shard_paths():
        table = read_table(path, ["stream", "environment", "key", "success"])
        for row in zip(*(column.to_pylist() for column in table.columns), strict=True):
            if row[0] == stream:
                held[row[1]][row[2]] = row[3]
    return held
