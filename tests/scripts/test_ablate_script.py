import csv
import importlib
import sys
from types import ModuleType

import numpy as np
import pytest

from lic_drake.estimate.estimator import Prediction
from lic_drake.estimate.features import ExperienceRows


@pytest.fixture
def script() -> ModuleType:
    return importlib.import_module("scripts.ablation.run")


def test_choices_of_the_best_score_share_ties(script) -> None:
    success = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    choices = script.Choices(success, np.array([3.0, 1.0]), np.array([0, 1]))
    share = choices.share(np.array([[2.0, 2.0, 1.0], [0.0, 5.0, 1.0]]))
    np.testing.assert_array_equal(share, [0.5, 1.0])
    assert choices.mean(share)[0] == pytest.approx(100.0 * (3.0 * 0.5 + 1.0) / 4.0)


def test_the_standard_error_is_that_of_independent_environments(script) -> None:
    rng = np.random.default_rng(0)
    environment = np.repeat(np.arange(40), 5)
    means, errors = [], []
    for _ in range(500):
        values = (rng.random(200) < np.repeat(rng.uniform(0.2, 0.8, 40), 5)).astype(float)
        choices = script.Choices(np.zeros((200, 1)), np.ones(200), environment)
        mean, error = choices.mean(values)
        means.append(mean)
        errors.append(error)
    assert np.mean(errors) == pytest.approx(np.std(means), rel=0.1)


def test_fits_never_see_the_fold_they_are_asked_about(script) -> None:
    class Spy:
        def fit(self, Z, f, environment):
            self.seen = set(Z[:, 0])
            return self

        def predict(self, Z):
            return Prediction(probability=self.values(Z), spread=np.zeros(len(Z)))

        def values(self, Z):
            assert not self.seen & set(Z[:, 0])
            return Z[:, 1]

    fold = np.arange(30) % 3
    rows = ExperienceRows(
        Z=np.column_stack([fold, np.arange(30.0)]), f=np.zeros(30), environment=fold
    )
    asked = np.arange(30) < 20
    values = script.held_out_values(Spy, rows, fold, asked)
    np.testing.assert_array_equal(values[asked], np.arange(20.0))
    assert np.isnan(values[~asked]).all()


def test_it_writes_tables_of_first_and_second_reaches(
    script, library, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(script, "OBSERVED", {"x0'": script.X0})
    monkeypatch.setattr(script, "GP_OBSERVED", ("x0'",))
    # Any quick estimator: the real ones take minutes.
    quick = script.FixedBandwidth(0.3)
    monkeypatch.setattr(script, "make_estimator", lambda name, *features: quick)
    monkeypatch.setattr(script, "small_local_neighbours", lambda features: quick)
    out = tmp_path / "out"
    monkeypatch.setattr(
        sys, "argv", ["ablate_estimators.py", str(library), "--folds", "2", "--out", str(out)]
    )
    assert script.main() == 0
    with (out / "ablation.csv").open() as file:
        rows = {(row["reach"], row["variant"]): row for row in csv.DictReader(file)}
    percent = {key: float(row["selected"].split()[0]) for key, row in rows.items()}
    assert percent["first", "oracle"] >= percent["first", "gp"] > percent["first", "RND"]
    assert rows["first", "gp"]["difference"] == "0.0 ± 0.0"
    assert percent["second", "oracle"] >= percent["second", "knn, x0'"]
    assert rows["second", "LIC-1, away from the first"]["likely_difference"] == "0.0 ± 0.0"
    text = (out / "ablation.md").read_text()
    assert "## library, first reach" in text
    assert "## library, second reach" in text


def test_a_missing_library_is_one_line_on_stderr(script, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "argv", ["ablate_estimators.py", str(tmp_path / "none")])
    assert script.main() == 2
    assert capsys.readouterr().err.startswith("error: no experience library at")
