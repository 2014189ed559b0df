import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from support.browser import assert_shows_a_scene, move_slider
from support.made_up import planar_library

from lic_drake.cli.main import main
from lic_drake.reach.scenario import load_scenario


@pytest.fixture
def taken() -> Iterator[str]:
    """A port that somebody else listens on."""
    with socket.socket() as other:
        other.bind(("", 0))
        other.listen()
        yield str(other.getsockname()[1])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["explore", "no-clutter"], "no category or library 'no-clutter'; choose one of cylinder-"),
        (["explore", "--method", "cost"], "--method cost estimates nothing to be shown"),
        (["explore", "--method", "imagine"], "--method imagine estimates nothing to be shown"),
        (["explore", "--method", "svm"], "unknown method 'svm'"),
        (["explore", "--port", "{taken}"], "is in use or does not exist; choose another --port"),
        (["explore", "--port", "70000"], "cannot listen on port 70000"),
        (["replay", "{library}", "18000"], "has rows 0 to "),
        (["replay", "{library}", "0", "--port", "{taken}"], "choose another --port"),
        (["replay", "nowhere", "0"], "no experience library at nowhere"),
    ],
)
def test_bad_input_costs_one_line(
    arguments: list[str],
    message: str,
    library: Path,
    taken: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main([text.format(taken=taken, library=library) for text in arguments]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert message in err


@contextmanager
def showing(*arguments: str) -> Iterator[str]:
    """Runs a command, gives its address, and ends it as Ctrl-C does."""
    process = subprocess.Popen(
        [sys.executable, "-m", "lic_drake", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "Ctrl-C" in line)
        yield line.split()[1]
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert err.endswith("lic: interrupted\n") and "Traceback" not in err


@pytest.fixture
def brief(tmp_path: Path) -> str:
    """Folder of a library of short reaches."""
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.2}}")
    return str(planar_library(tmp_path / "library", scenario).path)


def test_an_explorer_prints_its_address_and_ends_with_ctrl_c(brief: str) -> None:
    with showing("explore", brief, "--method", "knn1") as address:
        assert re.fullmatch(r"http://localhost:7\d\d\d", address)


def test_a_row_is_replayed_until_ctrl_c(brief: str) -> None:
    with showing("replay", brief, "0") as address:
        assert re.fullmatch(r"http://localhost:7\d\d\d", address)


def test_quick_imports_only_postpone() -> None:
    program = """
import sys
from lic_drake.cli.arguments import quick_imports
with quick_imports():
    import lic_drake.estimate.kept
assert "scipy.stats._stats_py" not in sys.modules
import scipy.stats
from scipy.stats import norm
assert scipy.stats.norm.cdf(0.0) == norm.cdf(0.0) == 0.5
"""
    subprocess.run([sys.executable, "-c", program], check=True)


@pytest.mark.slow
@pytest.mark.browser
def test_a_slider_in_a_browser_moves_the_picture(tmp_path: Path, chromium: str) -> None:
    with showing("explore", "--method", "knn1") as address:
        before, after = move_slider(chromium, address, tmp_path, "goal y [m]", -0.3)
    assert_shows_a_scene(before)
    assert_shows_a_scene(after)
    assert np.mean(np.abs(after - before).max(axis=2) > 0.1) > 2e-3
