"""`Cluster`: executors on the workers of a Dask scheduler. Needs the extra `cluster`."""

import asyncio
import logging
import pickle
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from functools import partial
from importlib.metadata import version
from typing import Any, Self

import lic_drake
from lic_drake.errors import ClusterError

CONNECT_S = 5.0
"""A scheduler that does not answer within this time is not there, seconds."""

LOOK_S = 1.0
"""Wall time between two looks at the list of workers, seconds."""


class Cluster:
    """The workers of a Dask scheduler, as a context manager.

    Each worker is a process with one thread, because a Drake diagram belongs to one thread, and
    works on one task at a time. Workers that join later are used, too.
    """

    def __init__(self, address: str) -> None:
        """Connects to a scheduler.

        Args:
            address: Its address, for instance tcp://node1:8786.

        Raises:
            ClusterError: Dask is not installed, or no scheduler that knows this lic_drake answers.
        """
        try:
            from distributed import Client
        except ModuleNotFoundError:
            raise ClusterError(
                'a cluster needs Dask; install it with: pip install "lic_drake[cluster]"'
            ) from None
        self._address = address
        self._workers: set[str] = set()
        self._next_look = 0.0
        # Dask tells the log what becomes an exception here anyway.
        for name in ("distributed", "distributed.client"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            # A client that cannot connect would linger and complain when it is collected. In a
            # thread, because a notebook has an event loop in this one.
            with ThreadPoolExecutor(max_workers=1) as thread:
                found = thread.submit(asyncio.run, _identify(address)).result()
            if found != "Scheduler":
                raise ValueError(f"found a {found}")
            self._client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            reason = str(error) or f"silence for {CONNECT_S:g} s"
            raise ClusterError(
                f"no Dask scheduler answers at {address!r} ({reason}); start one with: dask"
                " scheduler, which prints its address"
            ) from error
        try:
            self._client.run_on_scheduler(_give_up_at_first_death)
        except Exception as error:
            self.close()
            raise ClusterError(
                f"the scheduler at {address} cannot use this lic_drake ({error}); install the same"
                " one everywhere"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnects; scheduler and workers go on."""
        self._client.close(timeout=CONNECT_S)

    def num_workers(self) -> int:
        """Returns the present number of workers, at most a second old.

        Raises:
            ClusterError: A worker has several threads or another lic_drake, or the scheduler is
                gone.
        """
        if time.monotonic() >= self._next_look:
            try:
                threads: dict[str, int] = self._client.nthreads()
                new = [worker for worker in threads if worker not in self._workers]
                # A function of Python itself: one of ours would end a worker that lacks lic_drake.
                versions: dict[str, Any] = {}
                if new:
                    versions = self._client.run(
                        version, "lic_drake", workers=new, on_error="return"
                    )
            except Exception as error:
                raise self._lost() from error
            self._workers &= threads.keys()
            for worker in new:
                if not isinstance(versions[worker], OSError):  # Gone again.
                    self._refuse_unless_usable(worker, threads[worker], versions[worker])
                    self._workers.add(worker)
            self._next_look = time.monotonic() + LOOK_S
        return len(self._workers)

    def _refuse_unless_usable(self, worker: str, threads: int, found: object) -> None:
        if threads != 1:
            raise ClusterError(
                f"the worker {worker} has {threads} threads, but a reach needs a process of its"
                f" own; start it with: dask worker {self._address} --nworkers {threads}"
                " --nthreads 1"
            )
        if found != lic_drake.__version__:
            raise ClusterError(
                f"the worker {worker} lacks lic_drake {lic_drake.__version__} (it has: {found});"
                " install the same one everywhere"
            )

    def make_executor(self) -> Executor:
        """Returns an executor on the cluster; any number of them share the connection."""
        return _ClusterExecutor(self._client, self._pass_on)

    def _pass_on(self, ours: Future[Any], theirs: Future[Any]) -> None:
        """Hands the end of a task over, in the terms of this project."""
        from distributed import KilledWorker

        if theirs.cancelled():
            ours.set_exception(self._lost())
            return
        error = theirs.exception()
        if isinstance(error, KilledWorker):
            self._next_look = 0.0  # There is one worker less, until it is started again.
            ours.set_exception(BrokenExecutor(str(error)))
        elif isinstance(error, ImportError):
            ours.set_exception(
                ClusterError(f"a worker failed with: {error}; install the same packages everywhere")
            )
        elif error is not None:
            ours.set_exception(error)
        else:
            ours.set_result(theirs.result())

    def _lost(self) -> ClusterError:
        return ClusterError(f"lost the connection to the scheduler at {self._address}")


class _ClusterExecutor(Executor):
    """Dask's own executor, whose futures say what a slot needs to know."""

    def __init__(self, client: Any, pass_on: Callable[[Future[Any], Future[Any]], None]) -> None:
        self._executor = client.get_executor(pure=False, retries=0)
        self._pass_on = pass_on

    def submit[**P, T](self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Sends a call to a worker; it cannot be cancelled, since it may be running."""
        ours: Future[T] = Future()
        ours.set_running_or_notify_cancel()
        # Bytes: the scheduler would unpickle anything else, and need all that a worker needs.
        theirs = self._executor.submit(_call, pickle.dumps((fn, args, kwargs)))
        theirs.add_done_callback(partial(self._pass_on, ours))
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Waits for the calls."""
        self._executor.shutdown(wait=wait)


async def _identify(address: str) -> str:
    """Returns what answers at an address: Scheduler, Worker or Nanny."""
    from distributed import rpc

    async with asyncio.timeout(CONNECT_S), rpc(address, timeout=CONNECT_S) as peer:
        return str((await peer.identity())["type"])


def _call(message: bytes) -> Any:
    """Runs in a worker: makes the call that `submit` was asked for."""
    fn, args, kwargs = pickle.loads(message)
    return fn(*args, **kwargs)


def _give_up_at_first_death(dask_scheduler: Any) -> None:
    """Runs in the scheduler: a collection counts the deaths that a task causes by itself."""
    dask_scheduler.allowed_failures = 0
