"""A Dask scheduler and workers on the loopback, each in a process of its own."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from support.collecting import environment, wait_until

Process = subprocess.Popen[bytes]


class DaskCluster:
    """A scheduler to which workers can be added.

    Attributes:
        address: Address of the scheduler.
        scheduler: Its process.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: list[Process] = []
        self._file = folder / "scheduler.json"
        self.scheduler = self._start(
            *("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"),
            *("--no-dashboard", "--dashboard-address", "127.0.0.1:0"),
            *("--scheduler-file", str(self._file)),
        )
        # Dask makes the file first and writes into it afterwards.
        wait_until(lambda: self._file.exists() and self._file.read_text().endswith("}"))
        self.address = str(json.loads(self._file.read_text())["address"])

    def add_workers(self, count: int, *, threads: int = 1, nanny: bool = True) -> Process:
        """Starts workers, which nannies restart; returns when they have joined."""
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            before = len(client.nthreads())
            process = self._start(
                *("-m", "distributed.cli.dask_worker", self.address, "--nworkers", str(count)),
                *("--nthreads", str(threads), "--no-dashboard", "--memory-limit", "0"),
                *("--local-directory", str(self._folder), "--nanny" if nanny else "--no-nanny"),
            )
            wait_until(lambda: len(client.nthreads()) == before + count)
        return process

    def remove(self, process: Process) -> None:
        """Ends workers, the scheduler at once."""
        process.send_signal(signal.SIGTERM)
        process.wait(30)

    def close(self) -> None:
        """Ends all processes and what they have started."""
        for process in reversed(self._processes):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait(30)

    def _start(self, *arguments: str) -> Process:
        process = subprocess.Popen(
            [sys.executable, *arguments],
            # A task that kills its worker is given up sooner than by default, after 3 more deaths;
            # and workers do not watch all the time what they are doing.
            env=environment(
                DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1",
                DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED="False",
            ),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._processes.append(process)
        return process


@contextmanager
def dask_cluster(workers: int) -> Iterator[DaskCluster]:
    """Gives a scheduler with some workers."""
    with TemporaryDirectory() as folder:
        cluster = DaskCluster(Path(folder))
        try:
            if workers:
                cluster.add_workers(workers)
            yield cluster
        finally:
            cluster.close()
