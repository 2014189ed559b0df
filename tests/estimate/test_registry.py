import numpy as np
import pytest

from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap
from lic_drake.estimate.registry import estimator_names, make_estimator

NAMES = ("gp", "knn")
LIC2 = FeatureMap(goal=PLANAR_LIC1.goal, start=PLANAR_LIC1.start, observed=("first_start_y",))


def test_the_paper_s_estimators_are_known_with_the_process_first() -> None:
    assert estimator_names() == NAMES
    kinds = [type(make_estimator(name)).__name__ for name in NAMES]
    assert kinds == ["GaussianProcess", "NearestNeighbours"]
    assert [type(make_estimator(name, LIC2)).__name__ for name in NAMES] == ["LocalEstimator"] * 2
    np.testing.assert_array_equal(
        make_estimator("knn", SPACE_LIC1).held_out, [[-1, 0, 1, 0], [0, -1, 0, 1]]
    )


@pytest.mark.parametrize("name", NAMES)
def test_every_estimator_learns_a_known_surface(world, name: str) -> None:
    """Better than the constant rate, and nearly the best start, for goals that no row has."""
    library = world.library(environments=8)
    estimator = make_estimator(name).fit(library.X, library.y, library.groups)
    starts = world.grid()[:21, 2:]
    rng = np.random.default_rng(0)
    lost, error, spread = [], [], []
    for goal in rng.uniform([0.4, -0.4], [0.8, 0.4], (15, 2)):
        X = np.column_stack([np.tile(goal, (len(starts), 1)), starts])
        truth, values = world.probability(X), estimator.values(X)
        lost.append(truth.max() - truth[np.argmax(values)])
        error.append(np.mean((values - truth) ** 2))
        spread.append(np.mean((library.y.mean() - truth) ** 2))
    assert np.mean(lost) < 0.03
    assert np.mean(error) < 0.2 * np.mean(spread)


@pytest.mark.parametrize(
    ("name", "caution"),
    [
        ("gp", lambda process: process.hyperparameters_.reach_variance),
        ("knn", lambda neighbours: np.prod(neighbours.bandwidth_)),
    ],
)
def test_luck_shared_within_environments_is_not_read_as_surface(world, name, caution) -> None:
    library = type(world)(relief=0.3).library(environments=5, shared_luck=0.4)
    knowing = make_estimator(name).fit(library.X, library.y, library.groups)
    assert caution(knowing) > caution(make_estimator(name).fit(library.X, library.y))
