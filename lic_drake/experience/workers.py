"""Where tasks run: in this process, in worker processes on this machine, or in those of Dask.

Keep this module light to import: worker processes load it first.
"""

import asyncio
import logging
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Self

from lic_drake.errors import ClusterError

CONNECT_S = 5.0
"""Timeout for connecting to a Dask scheduler, seconds."""

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Workers:
    """Runs tasks in the current process: for notebooks, debugging and tests.

    `LocalWorkers` and `DaskWorkers` run them elsewhere. All are context managers.
    """

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """Ends the workers."""

    def capacity(self) -> int:
        """Returns the number of tasks that can run concurrently now."""
        return 1

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls a top-level function; the future raises BrokenExecutor if any worker died."""
        future: Future[T] = Future()
        try:
            future.set_result(work(*args))
        except Exception as error:
            future.set_exception(error)
        return future

    def restart(self) -> None:
        """Replaces dead workers; called while no task is running."""


class LocalWorkers(Workers):
    """Worker processes on this machine.

    Leaving the context terminates them immediately; they also end with this process, even if it is
    killed. Scripts need the usual `if __name__ == "__main__":`.
    """

    def __init__(self, count: int | None = None) -> None:
        """Creates a pool of `count` processes, by default one per core."""
        self._count = count or os.cpu_count() or 1
        self._start()

    def __exit__(self, *exception: object) -> None:
        self._parent.close()
        self._executor.shutdown(cancel_futures=True)

    def capacity(self) -> int:
        """Returns the number of processes."""
        return self._count

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls a function in a worker process."""
        try:
            with _starting_processes():
                return self._executor.submit(work, *args)
        except BrokenExecutor as error:  # An idle worker died.
            future: Future[T] = Future()
            future.set_exception(error)
            return future

    def restart(self) -> None:
        """Replaces the pool."""
        self.__exit__()
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
    before = {name: os.environ[name] for name in _THREADS if name in os.environ}
    in_main = threading.current_thread() is threading.main_thread()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT] if in_main else [])
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name in _THREADS:
            del os.environ[name]
        os.environ.update(before)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _end_with_parent(child: Connection) -> None:
    """Initializes a worker: it exits when the other end of the pipe is closed."""

    def wait_and_end() -> None:
        with suppress(EOFError, OSError):
            child.recv()
        os._exit(1)

    threading.Thread(target=wait_and_end, daemon=True).start()


class DaskWorkers(Workers):
    """The workers of a Dask scheduler; requires the extra `cluster`.

    Each must be a process with one thread, because Drake diagrams are not thread-safe. Workers may
    join later. Dask itself repeats a task whose worker died, up to `allowed-failures` times, and
    its nannies restart workers.
    """

    def __init__(self, address: str, most: int | None = None) -> None:
        """Connects to at most `most` (default: all) workers; raises a ClusterError if it fails."""
        try:
            from distributed import Client
        except ModuleNotFoundError:
            raise ClusterError(
                'a cluster needs Dask; install it with: pip install "lic_drake[cluster]"'
            ) from None
        self._address, self._most = address, most
        # Dask also logs the errors that are raised as exceptions here.
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            # Probe first: a client that cannot connect complains when it is garbage-collected. In
            # a thread, because a notebook runs an event loop in this one.
            with ThreadPoolExecutor(max_workers=1) as thread:
                found = thread.submit(asyncio.run, _identify(address)).result()
            if found != "Scheduler":
                raise ValueError(f"found a {found}")
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error) or f"timeout after {CONNECT_S:g} s"
            raise ClusterError(
                f"no Dask scheduler answers at {address!r} ({reason}); start one with: dask"
                " scheduler, which prints its address"
            ) from error
        self._executor = self._client.get_executor(pure=False)

    def __exit__(self, *exception: object) -> None:
        self._client.close(timeout=CONNECT_S)  # Scheduler and workers keep running.

    def capacity(self) -> int:
        """Returns the number of workers; raises a ClusterError if one has several threads."""
        try:
            threads: dict[str, int] = self._client.nthreads()
        except Exception as error:
            raise ClusterError(
                f"lost the connection to the scheduler at {self._address}"
            ) from error
        if worker := next((name for name, count in threads.items() if count != 1), None):
            raise ClusterError(
                f"the worker {worker} has {threads[worker]} threads, but reaches need processes"
                f" of their own; start it with: dask worker {self._address} --nworkers"
                f" {threads[worker]} --nthreads 1"
            )
        return min(len(threads), self._most or len(threads))

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls a function in a worker of the cluster."""
        # As bytes, which the scheduler need not unpickle: it may lack the workers' packages.
        future: Future[T] = self._executor.submit(_call, pickle.dumps((work, args)))
        return future


async def _identify(address: str) -> str:
    """Returns what answers at an address: Scheduler, Worker or Nanny."""
    from distributed import rpc

    async with asyncio.timeout(CONNECT_S), rpc(address, timeout=CONNECT_S) as peer:
        return str((await peer.identity())["type"])


def _call(message: bytes) -> Any:
    """Runs in a worker: calls the pickled function."""
    work, args = pickle.loads(message)
    return work(*args)
