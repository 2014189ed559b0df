"""A slot: an executor of its own that works on one task at a time.

A worker that dies takes nothing else with it, and it is plain whose fault it was.
"""

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, wait
from queue import SimpleQueue

from lic_drake.experience.journal import JournalTail, journal_path, read_journal
from lic_drake.experience.task import Task, TaskReport, run_task
from lic_drake.experience.workers import ctrl_c_held_back
from lic_drake.reach.request import ReachRequest

TASKS_PER_EXECUTOR = 20
"""A slot's executor is replaced after this many tasks, which bounds the memory of a worker.

Python's own `max_tasks_per_child` can hang (python/cpython#115634, up to 3.14).
"""

MAX_BREAKS = 2
"""A task that ended this many workers at the same reach is left out."""


class TaskState:
    """What the collecting process knows of a task.

    Attributes:
        task: The task.
        finished: Number of its reaches that are safe, as far as is known.
        successes: How many of them reached the goal.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self._breaks: list[int] = []
        self._tail = JournalTail(journal_path(task.shard))
        self.poll()

    def poll(self) -> None:
        """Looks into the journal."""
        self._tail.poll()
        self.finished, self.successes = self._tail.finished, self._tail.successes

    def end(self, report: TaskReport) -> None:
        """Takes what the worker counted; its journal may be gone."""
        self.finished, self.successes = report.finished, report.successes

    def is_deadly(self) -> bool:
        """Notes the death of a worker; tells whether this task kills wherever it runs.

        A worker that got further than its predecessor died of something else: a task is to blame
        when `MAX_BREAKS` workers died of it at the same reach.
        """
        self._breaks.append(self.finished)
        return self._breaks.count(self.finished) >= MAX_BREAKS

    def next_reach(self) -> ReachRequest | None:
        """Returns the first reach that is not finished, if any."""
        path = journal_path(self.task.shard)
        finished = {record.key for record in read_journal(path)[0]} if path.exists() else set()
        missing = self.task.missing
        for request in self.task.request.reaches(self.task.environment):
            if request.key not in finished and (missing is None or request.key in missing):
                return request
        return None


class Slot:
    """One executor and the task that it is working on.

    Attributes:
        state: The task; None while idle.
    """

    def __init__(self, make_executor: Callable[[], Executor], ended: "SimpleQueue[Slot]") -> None:
        """Makes an idle slot.

        Args:
            make_executor: Makes an executor for one task at a time.
            ended: Gets the slot when its task has ended.
        """
        self.state: TaskState | None = None
        self._ended = ended
        self._future: Future[TaskReport] = Future()
        self._make_executor = make_executor
        self._executor = make_executor()
        self._tasks = 0

    def start(self, state: TaskState) -> None:
        """Gives a task to an idle slot."""
        if self._tasks == TASKS_PER_EXECUTOR:
            self._renew()
        with ctrl_c_held_back():
            try:
                self._future = self._executor.submit(run_task, state.task)
            except BrokenExecutor:  # The worker died while it was idle.
                self._renew()
                self._future = self._executor.submit(run_task, state.task)
            self._tasks += 1
            self.state = state
            self._future.add_done_callback(lambda _: self._ended.put(self))

    def poll(self) -> None:
        """Looks how far the task is."""
        if self.state is not None:
            self.state.poll()

    def take(self) -> tuple[TaskState, Exception | None]:
        """Returns the ended task with what went wrong, if anything, and makes the slot idle."""
        assert self.state is not None
        state, self.state = self.state, None
        try:
            state.end(self._future.result())
        except Exception as error:
            state.poll()
            if isinstance(error, BrokenExecutor):
                self._renew()
            return state, error
        return state, None

    def close(self) -> None:
        """Waits until the worker has stopped."""
        self._future.cancel()
        if self.state is not None:
            # Python 3.12 may hang at its end when Ctrl-C interrupts the joining of a thread.
            wait([self._future])
        with ctrl_c_held_back():
            self._executor.shutdown()
        if self.state is not None:
            self.take()

    def _renew(self) -> None:
        self._executor.shutdown()
        self._executor = self._make_executor()
        self._tasks = 0
