"""The known success estimators. A new one is a file of your own with `register_estimator`."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from lic_drake.estimate.checks import EstimateError
from lic_drake.estimate.estimator import SuccessEstimator, UpdatableEstimator
from lic_drake.estimate.features import PLANAR_LIC1, FeatureMap
from lic_drake.estimate.gaussian_process import GaussianProcess
from lic_drake.estimate.linear_map import (
    MappedEstimator,
    can_be_relative,
    features_apart,
    relative_features,
)
from lic_drake.estimate.local import LocalEstimator
from lic_drake.estimate.local_process import choose_process
from lic_drake.estimate.nearest_neighbours import NearestNeighbours
from lic_drake.estimate.stacked import StackedEstimator
from lic_drake.registry import Registry

EstimatorFactory = Callable[[FeatureMap], SuccessEstimator]
"""Returns a new, unfitted estimator for what its features mean."""

_ESTIMATORS: Registry[EstimatorFactory] = Registry("estimator", EstimateError)

_RESERVED = ("rnd", "cost")
"""Methods of selection without an estimator."""


def register_estimator(name: str, factory: EstimatorFactory) -> None:
    """Makes an estimator known under a name, which is then a method of selection, too.

    Args:
        name: What the command line calls it.
        factory: Returns a new, unfitted one for a feature map; it satisfies `SuccessEstimator`.

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


def make_estimator(name: str, features: FeatureMap = PLANAR_LIC1) -> SuccessEstimator:
    """Returns a new, unfitted estimator.

    Args:
        name: One of `estimator_names`.
        features: What z means.

    Raises:
        EstimateError: The estimator is unknown.
    """
    return _ESTIMATORS.get(name)(features)


def estimator_names() -> tuple[str, ...]:
    """Returns the names of all known estimators, the default first."""
    return _ESTIMATORS.names()


def _process(features: FeatureMap) -> SuccessEstimator:
    """All rows of LIC-1; of LIC-2's many rows the nearest."""
    if can_be_relative(features):
        return _in_space(features, GaussianProcess, None)
    if not features.observed:
        return GaussianProcess()
    return LocalEstimator(choose_process, features.situation, size=800)


def _neighbours(features: FeatureMap) -> SuccessEstimator:
    if can_be_relative(features):
        return _in_space(features, NearestNeighbours, features.situation)
    if not features.observed:
        return NearestNeighbours()
    return LocalEstimator(
        lambda near: NearestNeighbours(neighbours=400, bandwidth=near.length_scale),
        features.situation,
        size=2000,
    )


def _in_space(
    features: FeatureMap, make: Callable[[], UpdatableEstimator], held_out: slice | None
) -> UpdatableEstimator:
    """Returns an estimator that looks at where the goal is from the start.

    Args:
        features: What z means.
        make: Returns the estimator that is told, for each stage.
        held_out: See `MappedEstimator`.
    """
    if not features.observed:
        return MappedEstimator(make(), relative_features(features), held_out)
    alone = replace(features, observed=())
    return StackedEstimator(
        make_first=lambda: _in_space(alone, make, alone.situation if held_out else None),
        make_second=make,
        alone=np.array([features.names.index(name) for name in alone.names]),
        matrix=features_apart(features, "start", "first_start"),
    )


register_estimator("gp", _process)
register_estimator("knn", _neighbours)
register_estimator(
    "gp-raw",
    lambda features: LocalEstimator(
        partial(choose_process, average=False), features.situation, size=800
    ),
)
