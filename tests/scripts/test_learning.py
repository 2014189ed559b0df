from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student_t

from lic_drake.errors import LibraryError
from lic_drake.estimate.estimator import Predictor
from lic_drake.estimate.features import ExperienceRows
from scripts.learning_curve.curve import (
    LearningPoint,
    learning_point,
    read_learning_curves,
    write_learning_curves,
)

SITUATION = slice(0, 1)
POINTS = [LearningPoint(size=250, value=0.1 + 0.2, low=0.1, high=0.7)]


class Counting:
    """Estimates each start's success by its rate among the rows it saw; notes their number."""

    def __init__(self) -> None:
        self.seen: list[int] = []
        self.environments: list[set[int]] = []

    def __call__(self) -> Predictor:
        return self

    def fit(self, Z, f, environment):
        self.seen.append(len(f))
        self.environments.append(set(environment))
        starts = np.unique(Z[:, 1])
        self.rate = {s: f[Z[:, 1] == s].mean() for s in starts}
        return self

    def predict(self, Z):
        rates = np.array([self.rate.get(s, 0.0) for s in Z[:, 1]])
        return type("Prediction", (), {"probability": rates})()


def make_library(environments: int = 6) -> ExperienceRows:
    """Three goals and four starts; start 3 succeeds always, the others half of the time."""
    e, g, s = (i.ravel() for i in np.indices((environments, 3, 4)))
    f = np.where(s == 3, 1.0, (e + g + s) % 2)
    return ExperienceRows(Z=np.column_stack([g, s]).astype(float), f=f, environment=e)


def test_with_enough_rows_the_best_start_is_selected() -> None:
    point = learning_point(Counting(), make_library(), SITUATION, 60, folds=6)
    assert (point.value, point.low, point.high) == (1.0, 1.0, 1.0)
    assert point.size == 60


def test_it_learns_from_so_many_rows_of_the_other_environments() -> None:
    make = Counting()
    learning_point(make, make_library(), SITUATION, 20, folds=3)
    assert make.seen == [20, 20, 20]
    assert all(len(environments) <= 4 for environments in make.environments)


def test_more_rows_than_there_are_is_all_of_them() -> None:
    make = Counting()
    point = learning_point(make, make_library(), SITUATION, 10_000, folds=6)
    assert make.seen == [60] * 6
    assert point.size == 60


def test_a_point_is_reproducible_and_has_students_interval_over_environments() -> None:
    rng = np.random.default_rng(0)
    rows = make_library(8)
    rows = ExperienceRows(
        Z=rows.Z, f=(rng.random(len(rows.f)) < 0.5).astype(float), environment=rows.environment
    )
    point = learning_point(Counting(), rows, SITUATION, 30, folds=8)
    assert point == learning_point(Counting(), rows, SITUATION, 30, folds=8)
    assert 0.0 <= point.low < point.value < point.high <= 1.0
    # Shares of three choices in each of 8 environments: the error is at most that of coins.
    assert point.high - point.low < 2 * student_t.ppf(0.95, 7) * 0.6 / np.sqrt(8)


def test_curves_come_back_as_they_were_written(tmp_path: Path) -> None:
    path = tmp_path / "new" / "curve.csv"
    write_learning_curves(path, {"gp": POINTS * 2, "knn": POINTS})
    assert read_learning_curves(path) == {"gp": POINTS * 2, "knn": POINTS}


def test_a_missing_curve_comes_with_its_command(tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match=r"no learning curve at .*scripts/learning_curve/run.py"):
        read_learning_curves(tmp_path / "none.csv")


@pytest.mark.parametrize("text", ["x,y\n1,2\n", "estimator,size,value,low,high\ngp,many,0,0,0\n"])
def test_another_file_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(LibraryError, match="is no learning curve"):
        read_learning_curves(tmp_path / "curve.csv")


def test_a_curve_that_cannot_be_written_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(LibraryError, match="cannot write"):
        write_learning_curves(tmp_path / "file" / "curve.csv", {"gp": POINTS})
