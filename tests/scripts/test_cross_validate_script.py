import csv
import importlib
import sys
from types import ModuleType

import numpy as np
import pytest


@pytest.fixture
def script() -> ModuleType:
    return importlib.import_module("scripts.cross_validation.run")


def _run(script: ModuleType, monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["cross_validate.py", *map(str, arguments)])
    return script.main()


def test_it_writes_scores_and_calibration_of_the_estimators(
    script, library, tmp_path, monkeypatch
) -> None:
    names = ["knn", "sklearn KNN, K=100"]
    out = tmp_path / "out"
    arguments = (library, "--estimators", *names, "--folds", 2, "--out", out)
    assert _run(script, monkeypatch, *arguments) == 0

    with (out / "cross_validation.csv").open() as file:
        scores = {row["estimator"]: row for row in csv.DictReader(file)}
    assert list(scores) == ["constant rate", *names]
    assert float(scores["constant rate"]["gain"]) == 0.0
    assert float(scores["knn"]["gain"]) > 0.0
    text = (out / "cross_validation.md").read_text()
    assert "1890 reaches of library in 6 environments, 2 folds" in text
    assert f"| knn | {float(scores['knn']['log_loss']):.4f} |" in text

    with (out / "calibration_curves.csv").open() as file:
        counts = [int(row["count"]) for row in csv.DictReader(file) if row["estimator"] == "knn"]
    assert np.sum(counts) == 1890


def test_a_missing_library_is_one_line_on_stderr(script, tmp_path, monkeypatch, capsys) -> None:
    assert _run(script, monkeypatch, tmp_path / "none") == 2
    error = capsys.readouterr().err
    assert error.startswith("error: no experience library at")
    assert error.count("\n") == 1
