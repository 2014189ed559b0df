import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
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


@pytest.mark.parametrize("command", ["explore", "replay"])
def test_it_prints_its_address_and_ends_with_ctrl_c(command: str, tmp_path: Path) -> None:
    scenario = load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.2}}")
    path = str(planar_library(tmp_path / "library", scenario).path)
    arguments = [path, "--method", "knn1"] if command == "explore" else [path, "0"]
    process = subprocess.Popen(
        [sys.executable, "-m", "lic_drake", command, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        assert process.stdout is not None
        line = next(line for line in process.stdout if "Ctrl-C" in line)
        assert line.startswith("open http://localhost:7")
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 130
    assert err.endswith("lic: interrupted\n") and "Traceback" not in err
