"""The known selection strategies by name."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.estimate.features import PLANAR_LIC1, ExperienceRows, FeatureMap, features_of
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.experience.pairs import pair_reaches
from lic_drake.select.baselines import CostSelector, RandomSelector
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel
from lic_drake.select.situation import Selection, Situation

if TYPE_CHECKING:
    from lic_drake.estimate.estimator import SuccessEstimator

IMAGINE = "imagine"
"""Name of the strategy that imagines the clutter, see `lic_drake.select.imagine`."""

type Columns = Mapping[str, NDArray[Any]]
"""Columns of a library by name."""


def silent(line: str) -> None:
    """Says nothing."""


class Selector(Protocol):
    """What every strategy offers."""

    @property
    def method(self) -> str:
        """Name of the strategy."""

    def select(self, situation: Situation) -> Selection:
        """Chooses an initial condition."""


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
    """Returns the names of all simple strategies; FIRST>LATER is one, too.

    The baselines and, for each estimator, LIC (LIC-1, then LIC-2) under its name and LIC-1 for all
    attempts under its name with a 1: the same where a category has no LIC-2. "imagine" is "gp" with
    further attempts from what was felt.
    """
    names = estimator_names()
    return ("rnd", "cost", *names, *(f"{name}1" for name in names), IMAGINE)


def check_method(method: str) -> list[str]:
    """Returns the one or two simple strategies of a strategy; a RequestError if it is unknown."""
    parts = method.split(">", 1)
    if not set(parts) <= set(method_names()):
        raise RequestError(
            f"unknown method {method!r}; choose one of {', '.join(method_names())}, or one for"
            " the first attempt and one for later ones, as in gp>cost"
        )
    return parts


def needs_library(method: str) -> bool:
    """Returns whether a strategy learns from a library; a RequestError if it is unknown."""
    return not set(check_method(method)) <= {"rnd", "cost"}


def make_selector(
    method: str,
    columns: Columns | None = None,
    rng: np.random.Generator | None = None,
    say: Callable[[str], None] = silent,
) -> Selector:
    """Returns a strategy, fitted to a library if it learns from one; see `fit_model`.

    Args:
        method: See `method_names`.
        columns: Columns of the experience library, if it learns from one. The clutter category
            there says what LIC observes.
        rng: Source of draws for RND; by default always the same ones.
        say: Receives a line before and after each fit, and before what else takes long.

    Raises:
        RequestError: The strategy is unknown or has no library to learn from.
    """
    parts = check_method(method)
    if len(parts) > 1:
        first, later = (make_selector(part, columns, rng, say) for part in parts)
        return FallbackSelector(first=first, later=later, method=method)
    if not needs_library(method):
        rng = np.random.default_rng(0) if rng is None else rng
        return RandomSelector(rng=rng) if method == "rnd" else CostSelector()
    if columns is None:
        raise RequestError(f"method {method!r} needs an experience library to learn from")
    if method == IMAGINE:
        from lic_drake.select.imagine import ImaginingSelector

        lic = make_selector("gp", columns, rng, say)
        assert isinstance(lic, LicSelector)
        return ImaginingSelector(lic, say=say)
    category = str(columns["category"][0])
    features, estimator, second = features_of(category), method, None
    if method not in estimator_names():
        estimator = method[:-1]
    elif features.second is not None:
        second = fit_model(method, features.second, pair_reaches(columns), category, say)
    first_model = fit_model(estimator, features.first, columns, category, say)
    return LicSelector(first_model, second, method=method)


def fit_model(
    estimator: str,
    features: FeatureMap,
    columns: Columns,
    category: str = "any category",
    say: Callable[[str], None] = silent,
) -> SuccessModel:
    """Returns an estimator fitted to a library D1, or to pairs D2 where features observe a reach.

    See `fit_rows`.
    """
    kind = "pairs of reaches" if features.observed else "reaches"
    rows, what = features.rows(columns), f"{kind} of {category}"
    return SuccessModel(estimator=fit_rows(estimator, rows, what, features, say), features=features)


def fit_rows(
    estimator: str,
    rows: ExperienceRows,
    what: str,
    features: FeatureMap = PLANAR_LIC1,
    say: Callable[[str], None] = silent,
) -> "SuccessEstimator":
    """Returns an estimator fitted to rows; `what` says in a line what they are.

    Its settings come from the simulated rows; those of other sources change the estimate, by their
    weight, but no setting. Fits are kept, see `lic_drake.estimate.kept`, and found again.
    """
    from lic_drake.estimate.kept import fit_as_kept, fit_path, keep_fit

    fitted = make_estimator(estimator, features)
    path, part = fit_path(estimator, features, rows), rows.simulated
    if path is not None and fit_as_kept(path, fitted, rows, say):
        return fitted
    say(f"fitting {estimator} on {len(rows.y)} {what} ...")
    began = time.perf_counter()
    if part.all() or not part.any():  # Without any simulated row all choose the settings.
        fitted.fit(rows.X, rows.y, rows.groups, rows.weight)
    else:
        fitted.fit(rows.X[part], rows.y[part], rows.groups[part], rows.weight[part])
        fitted = fitted.conditioned_on(rows.X, rows.y, rows.weight)
    say(f"fitted {estimator} in {time.perf_counter() - began:.1f} s")
    if path is not None:
        keep_fit(path, fitted, say)
    return fitted
