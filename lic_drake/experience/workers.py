"""Worker processes for a collection. Light to import: workers load it before anything heavy."""

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process


def make_process_pool() -> ProcessPoolExecutor:
    """Returns an executor with one worker process, started from a fork server."""
    return ProcessPoolExecutor(
        max_workers=1, mp_context=get_context("forkserver"), initializer=prepare_worker
    )


@contextmanager
def ctrl_c_held_back() -> Iterator[None]:
    """Lets Ctrl-C take effect only after the block; processes that start in it never see it.

    An executor that is interrupted while it starts a worker would forget about the worker, and
    a worker that is interrupted before `prepare_worker` runs would print a traceback.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # Python interrupts the main thread only.
        return
    held: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if held:
            signal.raise_signal(signal.SIGINT)


def prepare_worker() -> None:
    """Makes a process a quiet worker: one thread, deaf to Ctrl-C, gone when its parent is."""
    # Ctrl-C reaches the whole process group; the parent lets the workers finish their reach.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # As many workers as cores: threads within a worker would only fight for them.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    """Waits for the parent's end; an orphan of a killed parent would wait for work for ever."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
