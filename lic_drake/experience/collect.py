"""`collect`: fills a library with the reaches that it still lacks.

An environment is a task, and a task makes one shard.
"""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass

import pyarrow as pa

from lic_drake.errors import LibraryError
from lic_drake.experience.grid import (
    REQUEST_FILE,
    CollectionRequest,
    read_request,
    write_request,
)
from lic_drake.experience.journal import journal_path
from lic_drake.experience.lock import CollectionLock
from lic_drake.experience.progress import Progress, ProgressFunction
from lic_drake.experience.schema import read_table
from lic_drake.experience.slots import Slot, TaskState
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.task import ReachFunction, Task, simulate
from lic_drake.experience.workers import make_process_pool

POLL_S = 0.5
"""Wall time between two looks at the journals, seconds."""

MAX_BREAKS = 2
"""A task that ended this many workers is left out."""


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
    workers: int = 1,
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
        workers: Number of tasks at work at a time.
        make_executor: Makes an executor for one task at a time. Its workers must see the
            library's folder; `lambda: client.get_executor()` uses a Dask cluster.
        reach: Simulates a request; a top-level function.
        progress: Is called about twice a second.

    Raises:
        LibraryError: The library belongs to another request, holds a damaged file, or cannot be
            written. Workers have stopped, finished reaches are kept.
        KeyboardInterrupt: As on Ctrl-C; workers have stopped, finished reaches are kept.
    """
    library.create()
    with CollectionLock(library.path) as lock:
        _record_request(library, request)
        collection = _Collection(library, request, reach)
        slots = [Slot(make_executor) for _ in range(min(workers, len(collection.waiting)))]
        try:
            while collection.waiting or any(slot.state for slot in slots):
                for slot in slots:
                    if collection.waiting and slot.state is None:
                        slot.start(collection.waiting.popleft())
                for state, error in Slot.wait(slots, POLL_S):
                    if error is not None:
                        collection.handle(state, error)
                if progress is not None:
                    progress(collection.progress())
        finally:
            lock.stop_workers()
            for slot in slots:
                slot.close()
            final = collection.progress()
            if progress is not None:
                progress(final)
    return CollectionReport(progress=final, failed=tuple(collection.failed))


class _Collection:
    """The tasks of a collection and what became of them.

    Attributes:
        waiting: Tasks that no slot has begun.
        failed: Tasks that were given up.
    """

    def __init__(
        self, library: ExperienceLibrary, request: CollectionRequest, reach: ReachFunction
    ) -> None:
        self._began = time.monotonic()
        held = _held(library)
        self._total = self._stored = self._stored_successes = 0
        self._states: list[TaskState] = []
        for environment in request.environment_indices:
            keys = {item.key for item in request.reaches(environment)}
            missing = frozenset(keys - held.keys())
            self._total += len(keys)
            self._stored += len(keys) - len(missing)
            self._stored_successes += sum(held[key] for key in keys - missing)
            task = Task(
                library=library.path,
                request=request,
                environment=environment,
                missing=missing,
                reach=reach,
            )
            if missing:
                self._states.append(TaskState(task))
            else:  # A kill between writing the shard and deleting the journal leaves both.
                journal_path(task.shard).unlink(missing_ok=True)
        self._present = self._stored + sum(state.finished for state in self._states)
        self.waiting = deque(self._states)
        self.failed: list[FailedTask] = []

    def handle(self, state: TaskState, error: Exception) -> None:
        """Decides what becomes of a task that ended with an error.

        Raises:
            LibraryError: The task could not write; the others could not either.
        """
        if isinstance(error, LibraryError):
            raise LibraryError(f"{error}; finished reaches are kept, run the same command to go on")
        if isinstance(error, BrokenExecutor):
            state.breaks += 1
            if state.breaks < MAX_BREAKS:
                self.waiting.append(state)
                return
            reason = f"its worker process died {MAX_BREAKS} times"
        else:
            reason = " ".join(f"{type(error).__name__}: {error}".split())
        self.failed.append(FailedTask(environment=state.task.environment, reason=reason))

    def progress(self) -> Progress:
        """Returns the present state, as far as the journals were looked at."""
        return Progress(
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


def _held(library: ExperienceLibrary) -> dict[str, bool]:
    """Returns the keys of all reaches in a library with their success."""
    columns = ["key", "success"]
    tables = [read_table(path, columns) for path in library.shard_paths()]
    if not tables:
        return {}
    table = pa.concat_tables([table.replace_schema_metadata() for table in tables])
    return dict(zip(*(table.column(name).to_pylist() for name in columns), strict=True))
