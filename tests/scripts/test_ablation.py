import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit
from support.made_up import part_of_shipped

from lic_drake.estimate.features import ExperienceRows, FeatureMap
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.types import Vector
from scripts.ablation import run, space_features
from scripts.ablation.counts import BinomialProcess, CountProcess, DirichletProcess
from scripts.ablation.space_features import AGAIN, LOCAL, RELATIVE, second_table
from scripts.cross_validation import run as cross_validation


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two environments of the shipped library of cylinders: 15 goals and 21 starts in each."""
    path = tmp_path_factory.mktemp("few") / "library"
    return part_of_shipped(path, "cylinder-clutter", 2, least_y=0.15).path


def test_choices_of_the_best_score_share_ties() -> None:
    success = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    choices = run.Choices(success, np.array([3.0, 1.0]), np.array([0, 1]))
    share = choices.share(np.array([[2.0, 2.0, 1.0], [0.0, 5.0, 1.0]]))
    np.testing.assert_array_equal(share, [0.5, 1.0])
    assert choices.mean(share)[0] == pytest.approx(100.0 * (3.0 * 0.5 + 1.0) / 4.0)


class Spy:
    """Refuses to be asked about what it was fitted to."""

    def fit(self, X: Vector, y: Vector, groups: Vector) -> "Spy":
        self.seen = set(X[:, 0])
        return self

    def values(self, X: Vector) -> Vector:
        assert not self.seen & set(X[:, 0])
        return X[:, 1]


def test_fits_never_see_the_fold_they_are_asked_about() -> None:
    fold = np.arange(30) % 3
    asked = np.arange(30) < 20
    rows = ExperienceRows(
        X=np.column_stack([fold, np.arange(30.0)]),
        y=np.zeros(30),
        groups=fold,
        weight=np.ones(30),
        simulated=np.ones(30, dtype=bool),
    )
    values = run.held_out_values(Spy, rows, fold, asked)
    np.testing.assert_array_equal(values[asked], np.arange(20.0))
    assert np.isnan(values[~asked]).all()


def test_the_ablation_tabulates_first_and_second_reaches(
    library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "OBSERVED", {"x0'": run.X0})
    monkeypatch.setattr(run, "GP_OBSERVED", ("x0'",))
    # Any quick estimator: the real ones take minutes.
    quick = run.FixedBandwidth(0.3)
    monkeypatch.setattr(run, "make_estimator", lambda name, *features: quick)
    monkeypatch.setattr(run, "small_local_neighbours", lambda features: quick)
    arguments = ["run.py", str(library), "--folds", "2", "--out", str(tmp_path)]
    monkeypatch.setattr("sys.argv", arguments)
    run.main()
    with (tmp_path / "ablation.csv").open() as file:
        rows = {(row["reach"], row["variant"]): row for row in csv.DictReader(file)}
    percent = {key: float(row["selected"].split()[0]) for key, row in rows.items()}
    assert percent["first", "oracle"] >= percent["first", "gp"]
    assert rows["first", "gp"]["difference"] == "0.0 ± 0.0"
    assert percent["second", "oracle"] >= percent["second", "knn, x0'"]
    assert "## library, second reach" in (tmp_path / "ablation.md").read_text()


class Recalls:
    """Remembers which goals it was told, and likes starts near the goal."""

    def __init__(self, name: str, features: FeatureMap) -> None:
        self.goal = features.goal_matrix
        self.start = np.eye(len(features.columns))[features.decision][:2]

    def fit(self, X: Vector, y: Vector, groups: Vector) -> "Recalls":
        self.seen = {tuple(row) for row in np.round(X @ self.goal.T, 6)}
        return self

    def values(self, X: Vector) -> Vector:
        assert not self.seen & {tuple(row) for row in np.round(X @ self.goal.T, 6)}
        return -np.round(np.linalg.norm(X @ (self.start - self.goal).T, axis=1), 6)


def test_goals_in_space_are_held_out_and_second_starts_are_other_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(space_features, "make_estimator", Recalls)
    monkeypatch.setattr(space_features, "_gap", lambda *_: np.nan)
    columns = ExperienceLibrary(shipped_library("sphere-aperture-clutter")).columns()
    few = {key: values[columns["environment"] < 8] for key, values in columns.items()}
    found = space_features.hold_out_goals("gp", few)
    failures = found.won[RELATIVE].count(False)
    assert len(found.won[RELATIVE]) == 8 * 12
    # An estimate that knows nothing of the failure chooses as LIC-1, and would repeat itself.
    assert found.second[LOCAL] == found.second[AGAIN]
    assert found.repeated == failures == len(found.random)
    assert sum(found.random) < sum(found.second[AGAIN]) <= sum(found.second["possible"])
    assert f"| {sum(found.second[AGAIN])}/{failures} |" in second_table({"gp": found}).to_markdown()


def test_cross_validation_writes_scores_and_calibration(library: Path, tmp_path: Path) -> None:
    names = ["knn", "sklearn KNN, K=100"]
    cross_validation.run(library, names, 2, tmp_path)
    with (tmp_path / "cross_validation.csv").open() as file:
        scores = {row["estimator"]: row for row in csv.DictReader(file)}
    assert list(scores) == ["constant rate", *names]
    assert float(scores["constant rate"]["gain"]) == 0.0
    text = (tmp_path / "cross_validation.md").read_text()
    assert "630 reaches of library in 2 environments, 2 folds" in text
    assert f"| knn | {float(scores['knn']['log_loss']):.4f} |" in text
    with (tmp_path / "calibration_curves.csv").open() as file:
        counts = [int(row["count"]) for row in csv.DictReader(file) if row["estimator"] == "knn"]
    assert np.sum(counts) == 630


@pytest.mark.parametrize("make", [DirichletProcess, BinomialProcess])
def test_processes_of_counts_learn_a_smooth_probability(make: type[CountProcess]) -> None:
    rng = np.random.default_rng(0)
    cells = np.linspace(0.0, 1.0, 80)
    X = np.repeat(cells, 6)[:, None]
    true = 0.5 + 0.4 * np.sin(2.0 * np.pi * cells)
    y = (rng.uniform(size=480) < np.repeat(true, 6)).astype(float)
    estimator = make().fit(X, y, np.tile(np.arange(6), 80))
    learned, counted = estimator.values(cells[:, None]), y.reshape(80, 6).mean(axis=1)
    assert np.abs(learned - true).mean() < 0.8 * np.abs(counted - true).mean()


def test_laplaces_approximation_ends_at_the_mode() -> None:
    x = np.linspace(0.0, 1.0, 12)
    K = 2.0 * np.exp(-3.0 * np.abs(x[:, None] - x))
    wins, tries = np.arange(12.0), np.full(12, 12.0)
    _, mean, alpha = BinomialProcess()._condition(K, wins, tries)
    # The gradient of the log likelihood is that of the prior, K^-1 (f - mean).
    np.testing.assert_allclose(alpha, wins - tries * expit(mean + K @ alpha), atol=1e-6)
