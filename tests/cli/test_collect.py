import os
import pty
import socket
import subprocess
import sys
import termios
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from support.fake_reach import FakeReach, collect_here, comparable, expected_records, make_request

from lic_drake.cli.collect import LOG_EVERY_S, progress_display
from lic_drake.cli.main import main
from lic_drake.experience.collect import REQUEST_FILE, read_request
from lic_drake.experience.runner import Progress
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario

SMALL = ["--max-goals", "4", "--max-starts", "3"]

Collect = Callable[..., int]


@pytest.fixture
def reach(tmp_path: Path) -> FakeReach:
    return FakeReach(log=tmp_path / "calls")


@pytest.fixture
def collect(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, reach: FakeReach) -> Collect:
    """Runs `lic collect` with fake reaches in this process."""
    collect_here(monkeypatch, reach)
    return lambda *options: main(["collect", str(tmp_path / "new"), *options])


def test_collect_makes_a_library_and_says_what_it_holds(
    collect: Collect, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert collect("--environments", "3", *SMALL) == 0
    output, error = capsys.readouterr()
    assert error.endswith(
        f"3 environments x 4 goals x 3 starts, 36 reaches into {tmp_path / 'new'}\n"
    )
    assert "36 of 36 reaches (36 new in " in output
    assert "(90 % interval of the rate " in output
    assert comparable(ExperienceLibrary(tmp_path / "new").records()) == expected_records(
        make_request()
    )


def test_an_existing_library_goes_on_without_options_or_with_more_environments(
    collect: Collect, reach: FakeReach, capsys: pytest.CaptureFixture[str]
) -> None:
    assert collect("--environments", "1", *SMALL) == 0
    assert collect() == 0
    assert len(reach.calls()) == 12
    assert collect("--environments", "2") == 0
    assert len(reach.calls()) == 24
    assert "24 of 24 reaches (12 new" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--max-goals", "5"], "was begun with max_goals 4 instead of 5; resume with the same"),
        (["--set", "{stop: {timeout_s: 20}}"], "scenario_digest"),
        (["--stream", "tuning"], "unknown stream 'tuning'; choose one of"),
    ],
)
def test_a_different_request_is_refused_in_one_line(
    collect: Collect,
    reach: FakeReach,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    message: str,
) -> None:
    assert collect("--environments", "2", *SMALL) == 0
    capsys.readouterr()
    assert collect(*options) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("lic: error: ") and message in line
    assert len(reach.calls()) == 24


def test_options_reach_the_request(collect: Collect, tmp_path: Path) -> None:
    overrides = "{mpc: {preset: ijrr_2013}}"
    options = ["--environments", "1", "--first", "7", "--stream", "holdout", "--set", overrides]
    assert collect("--scenario", "cylinder-clutter", *options, *SMALL) == 0
    assert read_request(tmp_path / "new" / REQUEST_FILE) == make_request(
        scenario=load_scenario("cylinder-clutter", overrides),
        first_environment=7,
        environments=1,
        stream="holdout",
    )


def test_failed_environments_are_listed_and_make_exit_code_1(
    monkeypatch: pytest.MonkeyPatch,
    collect: Collect,
    reach: FakeReach,
    capsys: pytest.CaptureFixture[str],
) -> None:
    collect_here(monkeypatch, FakeReach(log=reach.log, failing_environment=1))
    assert collect("--environments", "3", *SMALL) == 1
    output, error = capsys.readouterr()
    assert "24 of 36 reaches" in output
    assert "lic: environment training-000001 failed: ArithmeticError: no such env" in error
    assert "the library is incomplete; run the same command to retry" in error


def test_a_share_is_a_part_of_the_environments(
    collect: Collect, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert collect("--environments", "5", *SMALL, "--share", "2/3") == 0
    output, error = capsys.readouterr()
    assert "2 environments x 4 goals x 3 starts, 24 reaches into" in error
    assert "24 of 24 reaches (24 new in " in output
    assert read_request(tmp_path / "new" / REQUEST_FILE) == make_request(environments=5)
    assert collect("--share", "0/3") == 2
    assert "k from 1 to n, for instance 3/20, got 0/3" in capsys.readouterr().err


def test_a_scheduler_that_is_not_there_is_one_line(
    collect: Collect, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="Dask is missing: pip install 'lic_drake[cluster]'")
    monkeypatch.setattr("lic_drake.experience.workers.CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        for wrong, reason in ((address, ""), ("node1", "missing port number")):
            assert collect(*SMALL, "--scheduler", wrong) == 2
            error = capsys.readouterr().err.splitlines()[-1]
            assert error.startswith(f"lic: error: no Dask scheduler answers at '{wrong}' ({reason}")


def test_without_dask_a_scheduler_is_refused_with_the_way_to_install_it(
    collect: Collect, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert collect(*SMALL, "--scheduler", "tcp://127.0.0.1:8786") == 2
    assert 'install it with: pip install "lic_drake[cluster]"\n' in capsys.readouterr().err


def test_a_real_reach_is_collected_with_a_progress_bar_on_a_terminal(tmp_path: Path) -> None:
    terminal, child_side = pty.openpty()
    termios.tcsetwinsize(terminal, (24, 120))
    options = ["--environments", "1", "--max-goals", "1", "--max-starts", "1", "--set"]
    overrides = "{stop: {timeout_s: 0.2}, clutter: {num_movable: 0, num_fixed: 1}}"
    library = str(tmp_path / "new")
    process = subprocess.Popen(
        [sys.executable, "-m", "lic_drake", "collect", library, *options, overrides],
        stdout=subprocess.PIPE,
        stderr=child_side,
    )
    output = process.communicate(timeout=120)[0].decode()
    os.close(child_side)
    shown = os.read(terminal, 100_000).decode()
    os.close(terminal)
    assert process.returncode == 0
    assert "1 of 1 reaches (1 new" in output
    assert "1/1 reaches" in shown
    assert "reaches/min" in shown
    (record,) = ExperienceLibrary(library).records()
    assert (record.outcome, record.duration_s) == ("timeout", pytest.approx(0.2, abs=0.05))


START = Progress(at_work=2, total=100, present=10, done=10, successes=4, elapsed_s=0.0, failed={})


def test_a_log_gets_a_line_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_display() as show:
        for tick in range(301):
            show(replace(START, done=10 + tick // 10, elapsed_s=0.5 * tick))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == int(150.0 / LOG_EVERY_S)
    # 12 of 90 reaches in a minute.
    assert lines[0] == (
        "22/100 reaches, 4 successes, 12 reaches/min in 2 environments, 0:06 h left"
    )
