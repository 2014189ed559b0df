import numpy as np
import pytest
from sklearn.metrics import brier_score_loss
from sklearn.metrics import log_loss as sklearn_log_loss

from lic_drake.estimate.features import ExperienceRows
from scripts.cross_validation.scores import (
    brier_score,
    hold_out_environments,
    log_loss,
    score,
    selection_success,
)


class EnvironmentSpy:
    """Predicts 0.5 and notes the environment, kept in the only feature, of what it is given."""

    def __init__(self, log: list[tuple[set[float], set[float]]]) -> None:
        self.log = log

    def fit(self, X, y, groups):
        assert np.array_equal(X[:, 0], groups)
        self.seen = set(X[:, 0])
        return self

    def predict_proba(self, X):
        self.log.append((self.seen, set(X[:, 0])))
        return np.full((len(X), 2), 0.5)


class Memory:
    """Predicts what it has seen of the same features, else the rate: overfits all it can."""

    def fit(self, X, y, groups):
        self.rate = y.mean()
        self.known = dict(zip(map(tuple, X), y, strict=True))
        return self

    def predict_proba(self, X):
        p = np.array([self.known.get(tuple(x), self.rate) for x in X])
        return np.column_stack([1.0 - p, p])


def _rows(X, y, groups) -> ExperienceRows:
    n = len(y)
    return ExperienceRows(
        X=np.asarray(X, float),
        y=np.asarray(y, float),
        groups=np.asarray(groups),
        weight=np.ones(n),
        simulated=np.ones(n, dtype=bool),
    )


@pytest.mark.parametrize(("folds", "fits"), [(10, 7), (3, 3)])
def test_no_fit_sees_an_environment_that_it_predicts(folds: int, fits: int) -> None:
    environment = np.repeat(np.arange(7), 5)
    log: list[tuple[set[float], set[float]]] = []
    rows = _rows(environment[:, None], environment % 2, environment)
    hold_out_environments(lambda: EnvironmentSpy(log), rows, folds=folds)
    assert len(log) == fits
    for seen, asked in log:
        assert not seen & asked
        assert seen | asked == set(range(7))


def test_gain_is_against_the_rate_of_the_other_environments() -> None:
    rows = _rows([[0.0]] * 4, [1, 1, 1, 0], [0, 0, 1, 1])
    held_out = hold_out_environments(Memory, rows)
    np.testing.assert_allclose(held_out.constant, [0.5, 0.5, 1.0, 1.0])
    gain = held_out.gain_by_environment()
    expected = log_loss(held_out.constant, rows.y) - log_loss(held_out.probability, rows.y)
    assert gain.mean() == pytest.approx(expected)
    result = score(held_out, slice(0, 1))
    assert result.gain_error == pytest.approx(abs(gain[0] - gain[1]) / 2.0)


def test_scores_equal_those_of_scikit_learn() -> None:
    rng = np.random.default_rng(0)
    p, f = rng.uniform(0.01, 0.99, 100), rng.integers(0, 2, 100).astype(float)
    assert log_loss(p, f) == pytest.approx(sklearn_log_loss(f, p))
    assert brier_score(p, f) == pytest.approx(brier_score_loss(f, p))


def test_selection_goes_to_the_best_score_within_environment_and_goal() -> None:
    #              goal, start
    X = [[0, 0], [0, 1], [1, 0], [1, 1], [0, 0], [0, 1]]
    rows = _rows(X, [1, 0, 0, 1, 0, 1], [4, 4, 4, 4, 7, 7])
    prefer_first = np.array([0.9, 0.1] * 3)
    assert selection_success(prefer_first, rows, slice(0, 1)).tolist() == [0.5, 0.0]
    assert selection_success(-prefer_first, rows, slice(0, 1)).tolist() == [0.5, 1.0]
