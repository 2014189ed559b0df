from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from support.select_surfaces import Bumps
from support.starts import LINE

from lic_drake.estimate.features import PLANAR_LIC1, features_of
from lic_drake.reach.start import Start
from lic_drake.select.lic import LicSelector
from lic_drake.select.objective import SuccessModel
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.types import Vector
from scripts.unknown_category.mixture import Category, MixtureLic, posterior

GOAL = np.array([0.6, 0.1, 0.0])
FIRST = Situation(p_WG=GOAL, starts=LINE)
# Two starts that the arm can take, and how far each bump reaches around them.
ONE, TWO = np.array([-0.3, 0.0]), np.array([0.2, 1.3])
WIDTH = np.array([0.1, 0.4])


def surface(at_one: float, at_two: float) -> SuccessModel:
    """P(success): so much at each of the two starts, and little elsewhere."""
    bumps = Bumps(np.array([ONE, TWO]), np.array([at_one, at_two]), WIDTH)
    return SuccessModel(estimator=bumps, features=PLANAR_LIC1)


def lic(at_one: float, at_two: float, second: tuple[float, float] | None = None) -> LicSelector:
    if second is None:
        return LicSelector(surface(at_one, at_two))
    estimator = surface(*second).estimator
    observing = SuccessModel(estimator=estimator, features=features_of("cylinder-clutter").second)
    return LicSelector(surface(at_one, at_two), observing)


def mixture(prior: float, one: LicSelector, two: LicSelector, **values: object) -> MixtureLic:
    categories = {
        "one": Category(probability=prior, lic=one),
        "two": Category(probability=1.0 - prior, lic=two),
    }
    return MixtureLic(categories, **values)


def failed_at(start: Vector, final: tuple[float, float] = (0.45, 0.05)) -> FailedReach:
    x0 = np.array([LINE.line.x_m, *start])
    known = FailedReach.from_start(Start(x0))
    names = ("final_x", "final_y", "final_phi", "final_vx", "final_vy")
    shown = dict(zip(names, (*final, 0.3, 0.01, -0.02), strict=True))
    return FailedReach(start=Start(x0), shown={**known.shown, **shown})


def after(*failed: FailedReach) -> Situation:
    return Situation(p_WG=GOAL, starts=LINE, failed=failed)


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(0.01, 1.0), st.floats(-50.0, 5.0)), min_size=1, max_size=5))
def test_bayes_rule_is_that_of_the_closed_form(categories: list[tuple[float, float]]) -> None:
    prior, log_likelihood = np.array(categories).T
    joint = prior / prior.sum() * np.exp(log_likelihood)
    found = posterior(prior / prior.sum(), log_likelihood)
    np.testing.assert_allclose(found, joint / joint.sum(), rtol=1e-9, atol=1e-300)


@pytest.mark.parametrize(("prior", "best"), [(0.9, ONE), (0.1, TWO)])
def test_the_likelier_category_decides_where_each_wants_another_start(
    prior: float, best: Vector
) -> None:
    chosen = mixture(prior, lic(0.9, 0.0), lic(0.0, 0.9)).select(FIRST)
    np.testing.assert_allclose(chosen.start.x0[1:], best, atol=0.02)
    assert chosen.probability == pytest.approx(0.9 * 0.9, abs=0.01)


def test_a_failure_speaks_against_the_category_that_promised_success() -> None:
    selector = mixture(0.6, lic(0.9, 0.0), lic(0.2, 0.7))
    belief = selector.belief(after(failed_at(ONE)))
    assert belief["one"] == pytest.approx(0.6 * 0.1 / (0.6 * 0.1 + 0.4 * 0.8), abs=1e-3)
    assert sum(belief.values()) == pytest.approx(1.0)


def test_the_second_attempt_follows_the_lic_2_of_the_category_that_is_left() -> None:
    one, two = lic(0.9, 0.1, second=(0.8, 0.0)), lic(0.1, 0.3, second=(0.0, 0.6))
    situation = after(failed_at(ONE))
    updated = mixture(0.6, one, two).select(situation)
    np.testing.assert_allclose(updated.start.x0[1:], TWO, atol=0.02)
    fixed = mixture(0.6, one, two, updates=False)
    assert fixed.belief(situation) == {"one": pytest.approx(0.6), "two": pytest.approx(0.4)}
    np.testing.assert_allclose(fixed.select(situation).start.x0[1:], ONE, atol=0.02)


@dataclass(frozen=True)
class EndsAt:
    """Failures that end at one place more densely than elsewhere."""

    y: float

    def log_density(self, z: ArrayLike, p_RE: ArrayLike) -> Vector:
        return np.where(np.abs(np.asarray(p_RE)[:, 1] - self.y) < 0.05, np.log(9.0), 0.0)


def test_where_a_failure_ended_tells_categories_apart_that_fail_as_often() -> None:
    categories = {
        name: Category(probability=0.5, lic=lic(0.5, 0.5), final=EndsAt(y))
        for name, y in (("left", 0.2), ("right", -0.2))
    }
    selector = MixtureLic(categories)
    assert selector.belief(after(failed_at(ONE, (0.5, 0.2))))["left"] == pytest.approx(0.9)
    assert selector.belief(after(failed_at(ONE, (0.5, -0.2))))["left"] == pytest.approx(0.1)
    unseen = FailedReach.from_start(Start(np.array([LINE.line.x_m, *ONE])))
    assert selector.belief(after(unseen))["left"] == pytest.approx(0.5)
