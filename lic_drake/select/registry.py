"""The known selection strategies by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.estimate.features import FeatureMap, features_of
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.experience.pairs import pair_reaches
from lic_drake.robots.arm import Arm
from lic_drake.select.baselines import CostSelector, RandomSelector
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel
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


@dataclass(frozen=True, kw_only=True)
class FallbackSelector:
    """One strategy for the first attempt and another one for all further ones."""

    first: Selector
    later: Selector
    method: str

    def select(self, situation: Situation) -> Selection:
        """Chooses an initial condition."""
        return (self.later if situation.failed else self.first).select(situation)


def method_names() -> tuple[str, ...]:
    """Returns the names of all simple strategies.

    They are the baselines and, for each estimator, LIC (LIC-1, then LIC-2) under its name and
    LIC-1 for all attempts under its name with a 1: the same where a category has no LIC-2.
    FIRST>LATER is a strategy, too.
    """
    return ("rnd", "cost", *estimator_names(), *(f"{name}1" for name in estimator_names()))


def split_method(method: str) -> tuple[str, str | None]:
    """Returns the strategies of the first attempt and, where another one follows, of the later."""
    first, arrow, later = method.partition(">")
    return first, later if arrow else None


def check_method(method: str) -> None:
    """Refuses unknown strategies.

    Raises:
        RequestError: The strategy is unknown.
    """
    for part in split_method(method):
        if part is not None and part not in method_names():
            raise RequestError(
                f"unknown method {method!r}; choose one of {', '.join(method_names())}, or one for"
                " the first attempt and one for later ones, as in gp>cost"
            )


def needs_library(method: str) -> bool:
    """Returns whether a strategy learns from an experience library.

    Raises:
        RequestError: The strategy is unknown.
    """
    check_method(method)
    return any(part not in ("rnd", "cost", None) for part in split_method(method))


def make_selector(
    method: str,
    arm: Arm,
    columns: Mapping[str, NDArray[Any]] | None = None,
    rng: np.random.Generator | None = None,
    category: str = "cylinder-clutter",
    pairs: Mapping[str, NDArray[Any]] | None = None,
) -> Selector:
    """Returns a strategy, fitted to a library if it learns from one.

    Args:
        method: See `method_names`.
        arm: The robot.
        columns: Columns of the experience library; not needed by the baselines.
        rng: Source of draws for RND; by default always the same ones.
        category: Clutter category, which says what LIC observes.
        pairs: Columns of D2 for LIC-2, see `lic_drake.experience.pairs`; by default it is
            made from the single reaches of `columns`, as in the paper.

    Raises:
        RequestError: The strategy is unknown or has no library to learn from, or there are pairs
            and no LIC-2.
    """
    check_method(method)
    first, later = split_method(method)
    if later is not None:
        return FallbackSelector(
            first=make_selector(first, arm, columns, rng, category, pairs),
            later=make_selector(later, arm, columns, rng, category, pairs),
            method=method,
        )
    if not needs_library(method):
        rng = np.random.default_rng(0) if rng is None else rng
        if method == "rnd":
            return RandomSelector(rng=rng)
        return CostSelector()
    if columns is None:
        raise RequestError(f"method {method!r} needs an experience library to learn from")
    features, only_first = features_of(category), method not in estimator_names()
    estimator = method[:-1] if only_first else method
    second = None
    if features.second is None and pairs is not None:
        raise RequestError(
            f"{category} has no LIC-2 that could learn from second attempts; leave them out"
        )
    if features.second is not None and not only_first:
        pairs = pair_reaches(columns) if pairs is None else pairs
        second = fit_model(estimator, features.second, pairs)
    first_model = fit_model(estimator, features.first, columns)
    return LicSelector(first_model, second, method=method)


def fit_model(
    estimator: str,
    features: FeatureMap,
    columns: Mapping[str, NDArray[Any]],
) -> SuccessModel:
    """Returns an estimator fitted to the columns of a library.

    Its settings come from the simulated rows; those of other sources change the estimate, by their
    weight, but no setting.

    Args:
        estimator: Its name, see `estimator_names`.
        features: What x is made of.
        columns: Of a library D1, or the pairs D2 where the features observe a first reach.
    """
    rows, fitted = features.rows(columns), make_estimator(estimator, features)
    part = rows.simulated
    if part.all() or not part.any():  # Without any simulated row all choose the settings.
        fitted.fit(rows.X, rows.y, rows.groups, rows.weight)
    else:
        fitted.fit(rows.X[part], rows.y[part], rows.groups[part], rows.weight[part])
        fitted = fitted.conditioned_on(rows.X, rows.y, rows.weight)
    return SuccessModel(estimator=fitted, features=features)
