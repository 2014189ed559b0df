"""Tasks for workers that import nothing of the package, so that their processes start quickly."""

import os
import signal
from pathlib import Path


def work(folder: Path, name: str, deaths: int = 0, death: signal.Signals = signal.SIGKILL) -> str:
    """Returns its name; but so many times, noted in the folder, it ends its process by a signal."""
    if len(deaths_of(folder, name)) < deaths:
        append(folder / name, "x")
        signal.raise_signal(death)  # To this very thread, like os.abort().
    return name


def deaths_of(folder: Path, name: str) -> str:
    """An x for each process that a task has ended."""
    path = folder / name
    return path.read_text() if path.exists() else ""


def count_threads() -> list[int]:
    """How many threads the linear algebra of a process may use."""
    import numpy as np
    import scipy.linalg
    from threadpoolctl import threadpool_info

    scipy.linalg.solve(np.eye(2), np.ones(2))
    return sorted({pool["num_threads"] for pool in threadpool_info()})


def append(path: Path, text: str) -> None:
    """Appends to a file that other processes append to, too."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.write(descriptor, text.encode())
    os.close(descriptor)
