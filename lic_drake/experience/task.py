"""What a worker does: the reaches into one environment, journalled one by one, make one shard."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from socket import gethostname

from lic_drake.errors import LibraryError
from lic_drake.experience.grid import CollectionRequest
from lic_drake.experience.journal import Journal, journal_path
from lic_drake.experience.lock import is_going_on
from lic_drake.experience.schema import read_table, to_records
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import ReachRecord, ReachRequest

ReachFunction = Callable[[ReachRequest], ReachRecord]
"""Simulates a request; a top-level function, so that worker processes can import it."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """The reaches into one environment that a library still lacks; plain data that pickles.

    Attributes:
        library: Folder of the library, as the worker sees it.
        lock: Lock of the collection; the worker goes on only while it is there.
        request: The whole collection.
        scenario_digest: Digest of its scenario in the collecting process.
        environment: Index of the environment.
        missing: Keys of the reaches to simulate; None: all of them.
        reach: Simulates one of them.
    """

    library: Path
    lock: Path
    request: CollectionRequest
    scenario_digest: str
    environment: int
    missing: frozenset[str] | None
    reach: ReachFunction

    @property
    def shard(self) -> Path:
        """Path of the shard that the task writes."""
        name = f"{self.request.stream}-{self.environment:06d}"
        return ExperienceLibrary(self.library).shard_path(name)


@dataclass(frozen=True, kw_only=True)
class TaskReport:
    """How far a task came.

    Attributes:
        finished: Number of its reaches that are now in the library or the journal.
        successes: How many of them reached the goal.
    """

    finished: int
    successes: int


def run_task(task: Task) -> TaskReport:
    """Simulates a task's reaches, going on where an earlier run was interrupted.

    Returns early, with the journal kept, when the collection stops.

    Raises:
        LibraryError: The journal or the shard cannot be written, finished reaches are kept; or
            this worker does not see the library or has another lic_drake than the collector.
    """
    library = ExperienceLibrary(task.library)
    requests = {request.key: request for request in task.request.reaches(task.environment)}
    missing = frozenset(requests) if task.missing is None else task.missing
    _refuse_a_strange_worker(task, missing - requests.keys())
    with Journal(journal_path(task.shard)) as journal:
        # Only now: opening a file makes a network file system look at the folder afresh.
        if not is_going_on(task.lock):
            if not journal.records:
                journal.delete()
            raise LibraryError(
                f"{gethostname()} sees another folder at {task.library} than the collector; workers"
                " need the library in a file system that they share"
            )
        shard = to_records(read_table(task.shard)) if task.shard.exists() else []
        present = {record.key: record for record in (*shard, *journal.records)}
        for key, request in requests.items():
            if key in present or key not in missing:
                continue
            if not is_going_on(task.lock):
                return _report(missing, present)
            record = task.reach(request)
            if record.key != key:
                raise ValueError(f"the record of request {key} has the key {record.key}")
            journal.append(record)
            present[key] = record
        # In the order of the request, whatever the order in which they were finished.
        order = {key: rank for rank, key in enumerate(requests)}
        rows = sorted(present.values(), key=lambda record: order.get(record.key, len(order)))
        library.write_shard(task.shard.stem, rows, task.request.scenario)
        journal.delete()
        return _report(missing, present)


def simulate(request: ReachRequest) -> ReachRecord:
    """Simulates a reach with Drake; the default of a collection."""
    from lic_drake.reach.rollout import run_reach

    return run_reach(request)


def _refuse_a_strange_worker(task: Task, unknown: frozenset[str]) -> None:
    """Refuses to work where the collecting process would not find its reaches again."""
    if not task.library.is_dir():
        raise LibraryError(
            f"{gethostname()} does not see {task.library}; workers need the library in a file"
            " system that they share"
        )
    if unknown or task.request.scenario.digest != task.scenario_digest:
        raise LibraryError(
            f"{gethostname()} computes other reaches from the scenario than the collector; install"
            " the same lic_drake everywhere"
        )


def _report(missing: frozenset[str], present: dict[str, ReachRecord]) -> TaskReport:
    done = [record for key, record in present.items() if key in missing]
    return TaskReport(finished=len(done), successes=sum(record.success for record in done))
