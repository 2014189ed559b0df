"""Where tasks run: in worker processes of this machine, or in this very process.

Light to import: worker processes load this module before anything heavy.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Protocol, Self

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Workers(Protocol):
    """What the runner asks of an executor: `LocalWorkers`, `DaskWorkers`, `ThisProcess`."""

    def capacity(self) -> int:
        """Returns how many tasks can run at a time; it may change."""
        ...

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Starts a call of a top-level function.

        Its future fails with a BrokenExecutor if a worker process died, perhaps another one's.
        """
        ...

    def restart(self) -> None:
        """Makes new workers after some died. No task is running."""
        ...


class ThisProcess:
    """Runs each task at once in this process: for notebooks, debugging and tests."""

    def capacity(self) -> int:
        """Returns 1."""
        return 1

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Makes the call."""
        future: Future[T] = Future()
        try:
            future.set_result(work(*args))
        except Exception as error:
            future.set_exception(error)
        return future

    def restart(self) -> None:
        """Does nothing."""


class LocalWorkers:
    """Worker processes of this machine, as a context manager.

    Leaving the context after an exception (Ctrl-C, full disk) ends the workers at once; they also
    end when this process does, however it dies. A script that uses them needs the usual
    `if __name__ == "__main__":`.
    """

    def __init__(self, count: int | None = None) -> None:
        """Makes a pool; its processes start with the first tasks.

        Args:
            count: Number of processes; by default one a core.
        """
        self._count = count or os.cpu_count() or 1
        self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self._parent.close()
        self._executor.shutdown(cancel_futures=True)
        self._parent.close()

    def capacity(self) -> int:
        """Returns the number of processes."""
        return self._count

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Starts a call in a process."""
        try:
            with _starting_processes():
                return self._executor.submit(work, *args)
        except BrokenExecutor as error:  # A worker died while it was idle.
            future: Future[T] = Future()
            future.set_exception(error)
            return future

    def restart(self) -> None:
        """Makes a new pool."""
        self._parent.close()
        self._executor.shutdown()
        self._start()

    def _start(self) -> None:
        context = get_context("spawn")
        # Workers wait for the end of a pipe whose other end only this process has.
        child, self._parent = context.Pipe(duplex=False)
        self._executor = ProcessPoolExecutor(
            self._count, mp_context=context, initializer=_end_with_parent, initargs=(child,)
        )


@contextmanager
def _starting_processes() -> Iterator[None]:
    """Lets processes that start in the block inherit what makes a good worker.

    They never see Ctrl-C, which reaches the whole process group, and their linear algebra has
    one thread: there are as many workers as cores.
    """
    in_main = threading.current_thread() is threading.main_thread()
    before = {name: os.environ.get(name) for name in _THREADS}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]) if in_main else None
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _end_with_parent(child: Connection) -> None:
    """Prepares a worker: it ends when the other end of the pipe is closed."""
    threading.Thread(target=_wait_and_end, args=(child,), daemon=True).start()


def _wait_and_end(child: Connection) -> Any:
    with suppress(EOFError, OSError):
        child.recv()
    os._exit(1)
