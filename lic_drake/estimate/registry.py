"""The success estimators by name. A new one is a file of your own with `register_estimator`."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from lic_drake.errors import EstimateError
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.registry import Registry

if TYPE_CHECKING:  # Names must be quick to list; scikit-learn takes most of a second to import.
    from lic_drake.estimate.estimator import SuccessEstimator

EstimatorFactory = Callable[[FeatureMap], "SuccessEstimator"]
"""Returns a new, unfitted estimator for features of this meaning."""

_ESTIMATORS: Registry[EstimatorFactory] = Registry("estimator", EstimateError)

_RESERVED = ("rnd", "cost")  # Methods of selection without an estimator.


def register_estimator(name: str, factory: EstimatorFactory) -> None:
    """Registers an estimator under a name, which is then a method of selection, too.

    Args:
        name: What the command line calls it.
        factory: Returns a new, unfitted `SuccessEstimator` for a feature map.

    Raises:
        EstimateError: The name is taken or means another method, or `factory` cannot be called.
    """
    if not callable(factory):
        raise EstimateError(
            f"estimator {name!r} needs a function of a feature map that returns it, got"
            f" {factory!r}; register the class or a lambda, not the estimator"
        )
    twins = (f"{name}1", name[:-1] if name.endswith("1") else None)
    if name in _RESERVED or any(twin in _ESTIMATORS.entries for twin in twins):
        raise EstimateError(
            f"{name!r} cannot be the name of an estimator, as it would mean two methods; choose"
            " another name"
        )
    _ESTIMATORS.register(name, factory)


def make_estimator(name: str, features: FeatureMap = PLANAR_LIC1) -> "SuccessEstimator":
    """Returns a new, unfitted estimator.

    Args:
        name: One of `estimator_names`.
        features: What x means.

    Raises:
        EstimateError: The estimator is unknown.
    """
    return _ESTIMATORS.get(name)(features)


def estimator_names() -> tuple[str, ...]:
    """Returns the names of all known estimators, the default first."""
    return _ESTIMATORS.names()


def _process(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, and the nearest of LIC-2's many rows."""
    if features.observed:
        from lic_drake.estimate.local import LocalEstimator, choose_process

        return LocalEstimator(choose_process, features.situation, size=800)
    from lic_drake.estimate.gaussian_process import GaussianProcess

    return GaussianProcess()


def _neighbours(features: FeatureMap) -> "SuccessEstimator":
    """Uses all rows for LIC-1, and the nearest of LIC-2's many rows."""
    if features.observed:
        from lic_drake.estimate.local import LocalEstimator, choose_neighbours

        return LocalEstimator(choose_neighbours, features.situation, size=2000)
    from lic_drake.estimate.nearest_neighbours import NearestNeighbours

    return NearestNeighbours(held_out=features.goal_matrix if features.relative else None)


register_estimator("gp", _process)
register_estimator("knn", _neighbours)
