import sys
from pathlib import Path

import pytest

from scripts.learning_curve import run as learning_curve
from scripts.learning_curve.curve import read_learning_curves


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["learning_curve.py", *map(str, arguments)])
    return learning_curve.main()


def test_it_learns_from_parts_of_the_shipped_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "curve.csv"
    assert run(monkeypatch, "--estimators", "knn", "--sizes", 250, 2000, "--out", out) == 0
    small, large = read_learning_curves(out)["knn"]
    assert (small.size, large.size) == (250, 2000)
    # A random start succeeds in 55 % of the library's reaches.
    assert 0.5 < small.value < 0.7
    assert 0.58 < large.value < 0.7
    assert small.low < small.value < small.high


def test_a_missing_library_is_one_line_on_stderr(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, "--library", tmp_path / "none") == 2
    error = capsys.readouterr().err
    assert error.startswith("error: no experience library at")
    assert error.count("\n") == 1
