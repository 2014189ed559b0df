"""Decisions from anybody's table, against a world whose probability of success is a formula."""

import numpy as np
import pyarrow as pa
import pytest

from lic_drake.estimate.neighbours import NearestNeighbours
from lic_drake.estimate.rollouts import Rollouts, read_rollouts
from lic_drake.evaluate.decisions import (
    DecisionModel,
    _like_situations,
    fit_rollouts,
    held_out_choices,
)
from lic_drake.evaluate.reliability import FEWEST


def probability(given: np.ndarray, decided: np.ndarray) -> np.ndarray:
    """Of success: highest where the first decision is the situation and the second one is 0."""
    return 0.85 * np.exp(-8.0 * (decided[:, 0] - given) ** 2 - 2.0 * decided[:, 1] ** 2)


def rollouts(num_groups: int, each: int, seed: int = 0) -> Rollouts:
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(num_groups), each)
    given = rng.uniform(-0.5, 0.5, num_groups)[group]
    decided = rng.uniform(-1.0, 1.0, (len(group), 2))
    success = rng.uniform(size=len(group)) < probability(given, decided)
    columns = {"a": decided[:, 0], "b": decided[:, 1], "s": given, "scene": group}
    table = pa.table(columns | {"success": success})
    return read_rollouts(table, decide=["a", "b"], given=["s"], group="scene")


@pytest.fixture(scope="module", params=["gp", "knn"])
def model(request: pytest.FixtureRequest) -> DecisionModel:
    return fit_rollouts(rollouts(60, 8), request.param)


def test_the_choice_is_the_best_of_a_fine_lattice(model: DecisionModel) -> None:
    low, high = model.rollouts.decisions.min(axis=0), model.rollouts.decisions.max(axis=0)
    lattice = np.stack(np.meshgrid(*np.linspace(low, high, 61).T), axis=-1).reshape(-1, 2)
    for s in (-0.4, 0.0, 0.3):
        chosen = model.choose({"s": s})
        values = np.array(list(chosen.values.values()))
        assert np.all((low <= values) & (values <= high))
        assert model.values(np.array([s]), values[None])[0] == pytest.approx(chosen.estimate)
        assert chosen.estimate > min(model.values(np.array([s]), lattice).max(), 1.0) - 0.02


@pytest.mark.parametrize("each", [8, 1])
def test_choices_succeed_as_often_as_stated_and_far_more_often_than_others(each: int) -> None:
    known = rollouts(800 // each, each)
    model = fit_rollouts(known, "knn")
    situations = np.linspace(-0.45, 0.45, 40)
    choices = [model.choose({"s": s}) for s in situations]
    truth = probability(situations, np.array([list(c.values.values()) for c in choices])).mean()
    intervals = np.array([c.interval for c in choices])
    low, high = intervals.mean(axis=0)
    # The best of all decisions is somewhat better here than the best of eight with its estimate.
    assert low - 0.08 < truth < high + 0.08
    assert truth > 2.0 * known.rows.y.mean()


def test_what_is_held_out_is_not_learned_from() -> None:
    # Outcomes are noise, which the nearest neighbour knows by heart.
    known = rollouts(200, 6)
    noise = np.random.default_rng(1).integers(0, 2, 200)[known.rows.groups]
    known.rows.y[:] = noise
    nearest = NearestNeighbours(neighbours=1, bandwidth=[1.0, 1.0, 1.0])
    nearest.fit(known.rows.X, known.rows.y)
    np.testing.assert_array_equal(nearest.values(known.rows.X), noise)
    _, successes = held_out_choices(nearest, known)
    assert len(successes) == 200 and 0.4 < successes.mean() < 0.6


@pytest.mark.parametrize(("each", "count"), [(8, 50), (2, 50), (1, 200)])
def test_sets_have_whole_groups_and_five_attempts_or_more(each: int, count: int) -> None:
    known = rollouts(count, each)
    part = np.random.default_rng(0).permutation(len(known.rows.y))
    sets = list(_like_situations(part, known.situations, known.rows.groups))
    np.testing.assert_array_equal(np.sort(np.concatenate(sets)), np.arange(len(part)))
    groups = [set(known.rows.groups[like]) for like in sets]
    assert sum(map(len, groups)) == count
    assert all(5 <= len(like) < 20 for like in sets)
    # With a single column sets are ranges of it.
    ends = sorted((np.ptp(known.situations[like]), len(like)) for like in sets)
    assert ends[-1][0] < 0.3


def test_without_enough_choices_no_probability_is_made_up() -> None:
    model = fit_rollouts(rollouts(FEWEST - 1, 8), "knn")
    chosen = model.choose({"s": 0.0})
    assert chosen.probability is None and chosen.interval is None
    assert 0.0 <= chosen.estimate <= 1.0
