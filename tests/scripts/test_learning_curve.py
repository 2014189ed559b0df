import csv
from pathlib import Path

import pytest
from support.made_up import part_of_shipped
from support.trial_rows import make_rows

from lic_drake.evaluate.trials import write_trials
from scripts.common import run_script
from scripts.learning_curve.collection import (
    SIZES,
    collection_table,
    first_reaches,
    folder_of,
)
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


def test_the_first_reaches_are_those_of_the_first_environments(tmp_path: Path) -> None:
    library = part_of_shipped(tmp_path / "library", "cylinder-clutter", 3)
    columns = first_reaches(library, 1000, tmp_path / "part").columns()
    assert len(columns["key"]) == 1000
    counted = [int((library.columns()["environment"] == i).sum()) for i in range(2)]
    assert [int((columns["environment"] == i).sum()) for i in range(2)] == [
        counted[0],
        1000 - counted[0],
    ]


def test_success_stands_beside_the_reaches_that_were_learned_from(tmp_path: Path) -> None:
    rows = [
        row
        for name, outcome in (("active", "1"), ("random", "0"))
        for size in SIZES[name]
        for row in make_rows("gp", [outcome, "1"], variant=f"{name} {size}")
    ]
    write_trials(folder_of(tmp_path) / "evaluation" / "trials.parquet", rows)
    counts = {row[:2]: row[-1] for row in collection_table(tmp_path).rows if row is not None}
    assert counts["where the estimate says so", "1,000"] == "2/2"
    assert counts["every start", "9,540"] == "1/2"
