"""The known selection strategies by name."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.robots.planar import PlanarArm
from lic_drake.select.baselines import CostSelector, RandomSelector
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Selection, Situation


class Selector(Protocol):
    """What every strategy offers."""

    @property
    def method(self) -> str:
        """Name of the strategy."""
        ...

    def select(self, situation: Situation) -> Selection:
        """Chooses an initial condition."""
        ...


def method_names() -> tuple[str, ...]:
    """Returns the names of all strategies: the baselines and one for each estimator."""
    return ("rnd", "cost", *estimator_names())


def needs_library(method: str) -> bool:
    """Tells whether a strategy learns from an experience library.

    Raises:
        RequestError: The strategy is unknown.
    """
    if method not in method_names():
        raise RequestError(f"unknown method {method!r}; choose one of {', '.join(method_names())}")
    return method not in ("rnd", "cost")


def make_selector(
    method: str,
    arm: PlanarArm,
    columns: Mapping[str, NDArray[Any]] | None,
    rng: np.random.Generator,
) -> Selector:
    """Returns a strategy, fitted to a library if it learns from one.

    Args:
        method: One of `method_names()`.
        arm: The robot.
        columns: Columns of the experience library; not needed by the baselines.
        rng: Source of draws for RND.

    Raises:
        RequestError: The strategy is unknown, or has no library to learn from.
    """
    if not needs_library(method):
        return RandomSelector(rng=rng) if method == "rnd" else CostSelector()
    if columns is None:
        raise RequestError(f"method {method!r} needs an experience library to learn from")
    rows = PLANAR_LIC1.rows(columns)
    estimator = make_estimator(method).fit(rows.Z, rows.f, rows.environment)
    return LicSelector(arm, estimator, PLANAR_LIC1, method=method)
