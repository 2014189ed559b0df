from dataclasses import replace

import pytest

from lic_drake.cli.progress import LOG_EVERY_S, ProgressDisplay
from lic_drake.experience.runner import Progress

START = Progress(at_work=2, total=100, present=10, done=10, successes=4, elapsed_s=0.0, failed={})


def test_a_log_gets_a_line_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressDisplay() as display:
        for tick in range(301):
            elapsed_s = 0.5 * tick
            display.show(replace(START, done=10 + tick // 10, elapsed_s=elapsed_s))
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    assert len(lines) == int(150.0 / LOG_EVERY_S)
    # 12 of 90 reaches in a minute.
    assert lines[0] == (
        "22/100 reaches, 4 successes, 12 reaches/min in 2 environments, 0:06 h left"
    )
    assert captured.err == ""
