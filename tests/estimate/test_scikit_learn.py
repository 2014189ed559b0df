import numpy as np
import pytest
from sklearn.neighbors import KNeighborsClassifier

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.scikit_learn import PEERS


def test_the_neighbours_give_what_the_classifier_gives(scattered) -> None:
    scale = scattered.Z.std(axis=0)
    classifier = KNeighborsClassifier().fit(scattered.Z / scale, scattered.f)
    queries = scattered.Z[:10] + 0.02
    peer = PEERS["sklearn KNN, K=5"]().fit(scattered.Z, scattered.f)
    np.testing.assert_allclose(
        peer.predict(queries).probability, classifier.predict_proba(queries / scale)[:, 1]
    )


def test_the_process_averages_and_smooths(world) -> None:
    library = world.library(environments=8)
    some = np.isin(library.Z[:, 0], [0.4, 0.6]) & (library.Z[:, 1] >= 0.0)
    peer = PEERS["sklearn GP, Matern 1/2"]().fit(library.Z[some], library.f[some])
    Z = np.unique(library.Z[some], axis=0)
    rate = [library.f[(library.Z == z).all(axis=1)].mean() for z in Z]
    truth = world.probability(Z)
    error = np.mean((peer.predict(Z).probability - truth) ** 2)
    assert error < 0.6 * np.mean((rate - truth) ** 2)


@pytest.mark.parametrize("name", PEERS)
def test_peers_ask_for_rows_first(name: str) -> None:
    with pytest.raises(EstimateError, match="call fit"):
        PEERS[name]().predict(np.zeros((1, 4)))
