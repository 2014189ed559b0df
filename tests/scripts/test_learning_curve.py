import csv
from pathlib import Path

import pytest
from support.made_up import part_of_shipped

from scripts.common import run_script
from scripts.learning_curve.run import main


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> None:
    monkeypatch.setattr("sys.argv", ["run.py", *map(str, arguments)])
    run_script(main)


def test_it_learns_from_parts_of_the_shipped_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "new" / "curve.csv"
    library = part_of_shipped(tmp_path / "library", "cylinder-clutter", 3)
    options = ("--library", library.path, "--estimators", "knn", "--out", out)
    run(monkeypatch, *options, "--sizes", 250, 1500)
    with out.open() as file:
        small, large = (
            {k: float(v) for k, v in row.items() if k != "estimator"}
            for row in csv.DictReader(file)
        )
    assert (small["size"], large["size"]) == (250, 1500)
    # Better than a random start.
    rate = library.columns()["success"].mean()
    assert rate + 0.03 < small["value"] < large["value"] < 0.7
    assert small["low"] < small["value"] < small["high"]


def test_a_missing_library_is_one_line_on_stderr(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as caught:
        run(monkeypatch, "--library", tmp_path / "none")
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("error: no experience library at")
    assert error.count("\n") == 1
