"""Registry of success estimators; user code adds one with `register_estimator`."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from lic_drake.errors import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.registry import Registry

if TYPE_CHECKING:  # Listing names must not import scikit-learn, which takes most of a second.
    from lic_drake.estimate.estimator import SuccessEstimator

EstimatorFactory = Callable[[FeatureMap], "SuccessEstimator"]
"""Returns a new, unfitted estimator."""
_ESTIMATORS: Registry[EstimatorFactory] = Registry("estimator", EstimateError)


def register_estimator(name: str, factory: EstimatorFactory) -> None:
    """Registers an estimator under a name, which is then also a selection method."""
    if not callable(factory):
        raise EstimateError(
            f"estimator {name!r} needs a function of a feature map, got {factory!r}; register a"
            " factory, not the estimator"
        )
    twins = (f"{name}1", name[:-1] if name.endswith("1") else None)
    if name in ("rnd", "cost", "imagine") or any(twin in _ESTIMATORS.entries for twin in twins):
        raise EstimateError(f"{name!r} would name two selection methods; choose another name")
    _ESTIMATORS.register(name, factory)


def make_estimator(name: str, features: FeatureMap = PLANAR_LIC1) -> "SuccessEstimator":
    """Returns a new, unfitted estimator for a feature map."""
    return _ESTIMATORS.get(name)(features)


def is_built_in(name: str) -> bool:
    """Returns whether an estimator is this package's own, not registered by others."""
    return _ESTIMATORS.get(name) in (_process, _neighbours)


def estimator_names() -> tuple[str, ...]:
    """Returns the names of all registered estimators, the default first."""
    return _ESTIMATORS.names()


def _process(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, only the nearest for LIC-2, which has many."""
    from lic_drake.estimate.gaussian_process import GaussianProcess
    from lic_drake.estimate.neighbours import LocalEstimator, choose_process

    if features.observed:
        return LocalEstimator(choose_process, features.situation, size=800)
    return GaussianProcess()


def _neighbours(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, only the nearest for LIC-2, which has many."""
    from lic_drake.estimate.neighbours import LocalEstimator, NearestNeighbours, choose_neighbours

    if features.observed:
        return LocalEstimator(choose_neighbours, features.situation, size=2000)
    return NearestNeighbours(held_out=features.goal_matrix if features.relative else None)


register_estimator("gp", _process)
register_estimator("knn", _neighbours)
