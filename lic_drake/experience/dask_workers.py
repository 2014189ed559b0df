"""`DaskWorkers`: the workers of a Dask scheduler. Requires the extra `cluster`."""

import asyncio
import logging
import pickle
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any, Self

from lic_drake.errors import ClusterError

CONNECT_S = 5.0
"""Timeout for connecting to a scheduler, seconds."""

LOOK_S = 1.0
"""Interval between updates of the list of workers, seconds."""


class DaskWorkers:
    """The workers of a Dask scheduler, as a context manager.

    Each must be a process with one thread, because Drake diagrams are not thread-safe. Workers may
    join later. Dask itself repeats a task whose worker died, up to `allowed-failures` times.
    """

    def __init__(self, address: str, most: int | None = None) -> None:
        """Connects to at most `most` (by default all) workers of the scheduler at an address.

        Raises:
            ClusterError: Dask is not installed, or no scheduler answers.
        """
        try:
            from distributed import Client
        except ModuleNotFoundError:
            raise ClusterError(
                'a cluster needs Dask; install it with: pip install "lic_drake[cluster]"'
            ) from None
        self._address, self._most = address, most
        self._count, self._next_look = 0, 0.0
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self._client.close(timeout=CONNECT_S)  # Scheduler and workers keep running.

    def capacity(self) -> int:
        """Returns the number of workers, updated once a second.

        Raises:
            ClusterError: A worker has several threads, or the connection is lost.
        """
        if time.monotonic() >= self._next_look:
            try:
                threads: dict[str, int] = self._client.nthreads()
            except Exception as error:
                raise self._lost() from error
            if worker := next((name for name, count in threads.items() if count != 1), None):
                raise ClusterError(
                    f"the worker {worker} has {threads[worker]} threads, but reaches need processes"
                    f" of their own; start it with: dask worker {self._address} --nworkers"
                    f" {threads[worker]} --nthreads 1"
                )
            self._count = min(len(threads), self._most or len(threads))
            self._next_look = time.monotonic() + LOOK_S
        return self._count

    def submit[T](self, work: Callable[..., T], /, *args: Any) -> Future[T]:
        """Calls the function in a worker."""
        ours: Future[T] = Future()
        # As bytes, which the scheduler need not unpickle: it may lack the workers' packages.
        message = pickle.dumps((work, args))
        theirs = self._client.submit(_call, message, pure=False)
        theirs.add_done_callback(partial(self._pass_on, ours))
        ours.add_done_callback(lambda ended: theirs.cancel() if ended.cancelled() else None)
        return ours

    def restart(self) -> None:
        """Does nothing: nannies restart workers."""

    def _pass_on[T](self, ours: Future[T], theirs: Any) -> None:
        """Passes the result or error of a Dask future on to ours."""
        from distributed import KilledWorker

        if ours.cancelled():
            return
        error = theirs.exception() if theirs.status == "error" else None
        if theirs.status == "finished":
            ours.set_result(theirs.result())
        elif isinstance(error, KilledWorker):
            ours.set_exception(RuntimeError("its worker processes died"))
        elif isinstance(error, ImportError):
            ours.set_exception(
                ClusterError(f"a worker failed with: {error}; install the same packages everywhere")
            )
        else:
            ours.set_exception(error or self._lost())

    def _lost(self) -> ClusterError:
        return ClusterError(f"lost the connection to the scheduler at {self._address}")


async def _identify(address: str) -> str:
    """Returns what answers at an address: Scheduler, Worker or Nanny."""
    from distributed import rpc

    async with asyncio.timeout(CONNECT_S), rpc(address, timeout=CONNECT_S) as peer:
        return str((await peer.identity())["type"])


def _call(message: bytes) -> Any:
    """Runs in a worker: calls the pickled function."""
    work, args = pickle.loads(message)
    return work(*args)
