"""A training within a budget can be interrupted at any reach, and goes on where it was."""

from pathlib import Path

import pytest

from lic_drake.errors import LicError
from lic_drake.evaluate import trial
from lic_drake.evaluate.training import METHODS, train, training_library
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.session import run_reach

QUICK = "{stop: {timeout_s: 0.5}}"


def test_an_interrupted_training_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = 5

    def interrupted(request: ReachRequest) -> ReachRecord:
        nonlocal left
        left -= 1
        if left < 0:
            raise KeyboardInterrupt
        return run_reach(request)

    monkeypatch.setattr(trial, "run_reach", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(tmp_path, "cylinder-clutter", QUICK, reaches=14, say=lambda _: None)
    held = training_library(tmp_path).columns()["key"].tolist()
    assert len(held) == 4  # An environment with four goals; the second one was under way.
    left = 1000
    lines: list[str] = []
    rows = train(tmp_path, "cylinder-clutter", QUICK, reaches=14, say=lines.append)
    won = sum(training_library(tmp_path).columns()["success"][:4])
    assert lines[0] == f"4 of 9 reaches, {won} reached; up to 8 environments with gp"
    reaches = training_library(tmp_path).columns()
    assert set(held) < set(reaches["key"]) and len(reaches["key"]) >= 9
    assert set(reaches["environment"][4:]) <= set(range(1, 9))
    assert {row.method for row in rows} == set(METHODS)
    assert left > 1000 - (len(reaches["key"]) - 4) - len(rows) - 1


def test_a_folder_of_another_scenario_is_refused(tmp_path: Path) -> None:
    train(tmp_path, "passage-clutter", QUICK, reaches=2, say=lambda _: None)
    with pytest.raises(LicError, match="the training"):
        train(tmp_path, "cylinder-clutter", QUICK, reaches=2)


def test_without_time_one_environment_is_learned_from_and_one_compared(tmp_path: Path) -> None:
    rows = train(tmp_path, "passage-clutter", QUICK, minutes=1e-6, say=lambda _: None)
    assert {(row.method, row.environment) for row in rows} == {(name, 0) for name in METHODS}
    assert set(training_library(tmp_path).columns()["environment"]) == {0}
