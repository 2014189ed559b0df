"""Finds Drake's public models, `package://drake_models`, and never waits long for a network."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from pydrake.multibody.parsing import PackageMap

from lic_drake.errors import ModelError

PACKAGE = "drake_models"
"""Name of the package."""

DOWNLOAD_S = 60.0
"""How long a download may take, seconds."""

GRACE_S = 2.0
"""How long an interrupted program may take to clean up, seconds."""

_NETWORK = "DRAKE_ALLOW_NETWORK"
_DOWNLOAD = f"from pydrake.multibody.parsing import PackageMap; PackageMap().GetPath({PACKAGE!r})"


def find_drake_models(download_s: float = DOWNLOAD_S, say: Callable[[str], None] = print) -> Path:
    """Returns the folder of the package.

    Looks in the folders of ROS_PACKAGE_PATH, then in the cache of Drake's own downloads, and lets
    Drake download at last.

    Args:
        download_s: How long a download may take, seconds.
        say: Gets a line before a download.

    Raises:
        ModelError: It is nowhere, and there is no network, or one that is too slow.
    """
    packages = PackageMap.MakeEmpty()
    packages.PopulateFromRosPackagePath()
    if packages.Contains(PACKAGE):
        return Path(packages.GetPath(PACKAGE))
    found = _cached()
    if found is None:
        say(f"downloading package://{PACKAGE}, for {download_s:g} s at most")
        runs_in_time([sys.executable, "-c", _DOWNLOAD], download_s)
        found = _cached()
    if found is None:
        raise ModelError(
            f"package://{PACKAGE} is not on this machine and could not be downloaded within"
            f" {download_s:g} s; name a folder that holds it in ROS_PACKAGE_PATH"
        )
    return found


def runs_in_time(command: Sequence[str], limit_s: float) -> bool:
    """Runs a program silently; interrupts it and all it started when its time is over.

    Args:
        command: The program and its arguments.
        limit_s: Its time, seconds.

    Returns:
        Whether it ended well within its time.
    """
    process = subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return process.wait(limit_s) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        # An interrupt first: it lets Drake's downloader remove its temporary files.
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(GRACE_S)
        with suppress(ProcessLookupError):  # Nobody is left.
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _cached() -> Path | None:
    """Returns where Drake's download is, if it was ever made."""
    with _offline():
        try:
            return Path(PackageMap().GetPath(PACKAGE))
        except RuntimeError:  # Without a network, Drake says at once that there is none.
            return None


@contextmanager
def _offline() -> Iterator[None]:
    """Keeps Drake from using a network."""
    before = os.environ.get(_NETWORK)
    os.environ[_NETWORK] = "none"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_NETWORK]
        else:
            os.environ[_NETWORK] = before
