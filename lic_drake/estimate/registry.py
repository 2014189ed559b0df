"""Registry of success estimators; user code adds one with `register_estimator`."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from lic_drake.errors import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.registry import Registry

if TYPE_CHECKING:  # Listing names must not import scikit-learn, which takes most of a second.
    from lic_drake.estimate.estimator import SuccessEstimator

EstimatorFactory = Callable[[FeatureMap], "SuccessEstimator"]
"""Returns a new, unfitted estimator for a feature map."""

_ESTIMATORS: Registry[EstimatorFactory] = Registry("estimator", EstimateError)

_RESERVED = ("rnd", "cost")  # Selection methods without an estimator.


def register_estimator(name: str, factory: EstimatorFactory) -> None:
    """Registers an estimator under a name, which is then also a selection method.

    Args:
        name: Its name on the command line.
        factory: Returns a new, unfitted `SuccessEstimator` for a feature map.

    Raises:
        EstimateError: The name is taken or ambiguous, or `factory` is not callable.
    """
    if not callable(factory):
        raise EstimateError(
            f"estimator {name!r} needs a function of a feature map, got {factory!r}; register a"
            " factory, not the estimator"
        )
    twins = (f"{name}1", name[:-1] if name.endswith("1") else None)
    if name in _RESERVED or any(twin in _ESTIMATORS.entries for twin in twins):
        raise EstimateError(f"{name!r} would name two selection methods; choose another name")
    _ESTIMATORS.register(name, factory)


def make_estimator(name: str, features: FeatureMap = PLANAR_LIC1) -> "SuccessEstimator":
    """Returns a new, unfitted estimator for a feature map.

    Raises:
        EstimateError: The name is unknown, see `estimator_names`.
    """
    return _ESTIMATORS.get(name)(features)


def estimator_names() -> tuple[str, ...]:
    """Returns the names of all registered estimators, the default first."""
    return _ESTIMATORS.names()


def _process(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, only the nearest for LIC-2, which has many."""
    if features.observed:
        from lic_drake.estimate.local import LocalEstimator, choose_process

        return LocalEstimator(choose_process, features.situation, size=800)
    from lic_drake.estimate.gaussian_process import GaussianProcess

    return GaussianProcess()


def _neighbours(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, only the nearest for LIC-2, which has many."""
    if features.observed:
        from lic_drake.estimate.local import LocalEstimator, choose_neighbours

        return LocalEstimator(choose_neighbours, features.situation, size=2000)
    from lic_drake.estimate.nearest_neighbours import NearestNeighbours

    return NearestNeighbours(held_out=features.goal_matrix if features.relative else None)


register_estimator("gp", _process)
register_estimator("knn", _neighbours)
