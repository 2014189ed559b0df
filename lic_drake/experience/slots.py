"""A slot: an executor of its own that works on one task at a time.

A worker that dies takes nothing else with it, and it is plain whose fault it was.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait

from lic_drake.experience.journal import JournalTail, journal_path
from lic_drake.experience.task import Task, TaskReport, run_task
from lic_drake.experience.workers import ctrl_c_held_back

TASKS_PER_EXECUTOR = 20
"""A slot's executor is replaced after this many tasks, which bounds the memory of a worker.

Python's own `max_tasks_per_child` can hang (python/cpython#115634, up to 3.14).
"""


class TaskState:
    """What the collecting process knows of a task.

    Attributes:
        task: The task.
        breaks: Number of workers that died of it.
        finished: Number of its reaches that are safe, as far as is known.
        successes: How many of them reached the goal.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.breaks = 0
        self._tail = JournalTail(journal_path(task.shard))
        self.poll()

    def poll(self) -> None:
        """Looks into the journal."""
        self._tail.poll()
        self.finished, self.successes = self._tail.finished, self._tail.successes


class Slot:
    """One executor and the task that it is working on.

    Attributes:
        state: The task; None while idle.
    """

    def __init__(self, make_executor: Callable[[], Executor]) -> None:
        self.state: TaskState | None = None
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

    def take(self) -> tuple[TaskState, Exception | None] | None:
        """Returns an ended task with what went wrong, if anything, and makes the slot idle."""
        if self.state is None:
            return None
        if not self._future.done():
            self.state.poll()
            return None
        state, self.state = self.state, None
        try:
            report = self._future.result()
        except Exception as error:
            state.poll()
            if isinstance(error, BrokenExecutor):
                self._renew()
            return state, error
        state.finished, state.successes = report.finished, report.successes
        return state, None

    def close(self) -> None:
        """Waits until the worker has stopped."""
        self._future.cancel()
        self._executor.shutdown()
        self.take()

    def _renew(self) -> None:
        self._executor.shutdown()
        self._executor = self._make_executor()
        self._tasks = 0

    @staticmethod
    def wait(
        slots: Sequence["Slot"], timeout_s: float
    ) -> Iterator[tuple[TaskState, Exception | None]]:
        """Waits until a task ends or the time is over; yields the tasks that have ended."""
        busy = [slot._future for slot in slots if slot.state is not None]
        wait(busy, timeout=timeout_s, return_when=FIRST_COMPLETED)
        for slot in slots:
            ended = slot.take()
            if ended is not None:
                yield ended
