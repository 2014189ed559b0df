"""Executors: worker processes on this machine, or the current process.

Keep this module light to import: worker processes load it first.
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
    """Executor interface of the runner: `LocalWorkers`, `DaskWorkers`, `ThisProcess`."""

    def capacity(self) -> int:
        """Returns the current number of tasks that can run concurrently."""

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls a top-level function in a worker.

        The future raises BrokenExecutor if any worker process died.
        """
        raise NotImplementedError

    def restart(self) -> None:
        """Replaces dead workers; called while no task is running."""


class ThisProcess:
    """Runs tasks synchronously in the current process: for notebooks, debugging and tests."""

    def capacity(self) -> int:
        """Returns 1."""
        return 1

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls the function."""
        future: Future[T] = Future()
        try:
            future.set_result(work(*args))
        except Exception as error:
            future.set_exception(error)
        return future

    def restart(self) -> None:
        """Does nothing."""


class LocalWorkers:
    """Worker processes on this machine, as a context manager.

    Leaving the context with an exception (Ctrl-C, full disk) terminates the workers immediately;
    they also end with this process, even if it is killed. Scripts need the usual
    `if __name__ == "__main__":`.
    """

    def __init__(self, count: int | None = None) -> None:
        """Creates a pool of `count` processes, by default one per core."""
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
        """Calls the function in a worker process."""
        try:
            with _starting_processes():
                return self._executor.submit(work, *args)
        except BrokenExecutor as error:  # An idle worker died.
            future: Future[T] = Future()
            future.set_exception(error)
            return future

    def restart(self) -> None:
        """Replaces the pool."""
        self._parent.close()
        self._executor.shutdown()
        self._start()

    def _start(self) -> None:
        context = get_context("spawn")
        # Workers wait on a pipe whose other end only this process holds.
        child, self._parent = context.Pipe(duplex=False)
        self._executor = ProcessPoolExecutor(
            self._count, mp_context=context, initializer=_end_with_parent, initargs=(child,)
        )


@contextmanager
def _starting_processes() -> Iterator[None]:
    """Makes processes that start in the block ignore Ctrl-C and use one BLAS thread.

    Ctrl-C reaches the whole process group, and there are as many workers as cores.
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
    """Initializes a worker: it exits when the other end of the pipe is closed."""
    threading.Thread(target=_wait_and_end, args=(child,), daemon=True).start()


def _wait_and_end(child: Connection) -> Any:
    with suppress(EOFError, OSError):
        child.recv()
    os._exit(1)
