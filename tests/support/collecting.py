"""`lic collect` with fake reaches in processes of its own, for tests that kill them."""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from support.fake_reach import FakeReach

TESTS = Path(__file__).parents[1]
OPTIONS = ("--environments", "3", "--max-goals", "4", "--max-starts", "3")
"""The options of `fake_reach.make_request()`."""

SCRIPT = """
import pickle, sys
from functools import partial
from lic_drake.cli.main import main
import lic_drake.experience.collect as module
reach = pickle.loads(bytes.fromhex(sys.argv[1]))
module.collect = partial(module.collect, reach=reach)
sys.exit(main(["collect", *sys.argv[2:]]))
"""

Start = Callable[..., "subprocess.Popen[str]"]


@contextmanager
def collections() -> Iterator[Start]:
    """Gives a function that starts `lic collect` with a fake reach in its own process group."""
    started: list[subprocess.Popen[str]] = []
    # A killed process leaves its temporary files, and pytest's folders are too deep for a socket.
    with TemporaryDirectory() as folder:

        def start(library: Path, reach: FakeReach, *options: str) -> "subprocess.Popen[str]":
            message = pickle.dumps(reach).hex()
            process = subprocess.Popen(
                [sys.executable, "-c", SCRIPT, message, str(library), *OPTIONS, *options],
                env=environment(TMPDIR=folder),
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
            started.append(process)
            return process

        yield start
        for process in started:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()


def environment(**values: str) -> dict[str, str]:
    """The environment of a process that can import the fakes."""
    path = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path, **values}


def wait_until(condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def is_alive(process: int) -> bool:
    """Whether a process runs; one that has ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
