import subprocess
import sys

import numpy as np
import pytest

from lic_drake.errors import EstimateError
from lic_drake.estimate import registry
from lic_drake.estimate.features import PLANAR_LIC1, SPACE_LIC1, FeatureMap
from lic_drake.estimate.registry import estimator_names, make_estimator, register_estimator

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


def test_an_unknown_estimator_is_named_with_the_known_ones() -> None:
    with pytest.raises(EstimateError, match=r"'forest'.*gp, knn"):
        make_estimator("forest")


def test_an_estimator_can_be_added_by_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry._ESTIMATORS, "entries", dict(registry._ESTIMATORS.entries))
    given = []
    register_estimator("mine", lambda features: given.append(features) or make_estimator("knn"))
    assert make_estimator("mine") is not make_estimator("mine")
    assert given == [PLANAR_LIC1, PLANAR_LIC1]


def test_names_are_known_without_loading_scikit_learn() -> None:
    script = (
        "import sys; from lic_drake.estimate.registry import estimator_names;"
        " assert estimator_names(); assert 'sklearn' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)


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
