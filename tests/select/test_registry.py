from pathlib import Path

import numpy as np
import pytest
from support.fake_reach import fill_library
from support.starts import LINE

from lic_drake.errors import RequestError
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.start import Start
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import (
    check_method,
    make_selector,
    method_names,
    needs_library,
)
from lic_drake.select.situation import FailedReach, Situation

GOAL = np.array([0.6, 0.1, 0.0])


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    path: Path = tmp_path_factory.mktemp("library")
    return ExperienceLibrary(fill_library(path)).columns()


@pytest.mark.parametrize("method", [*method_names(), "gp>cost", "rnd>rnd", "knn1>gp"])
def test_a_known_strategy_is_accepted_and_named_in_its_selections(
    method: str, columns: dict[str, np.ndarray]
) -> None:
    check_method(method)
    assert needs_library(method) == (method not in ("rnd", "cost", "rnd>rnd"))
    selector = make_selector(method, columns)
    assert selector.method == method


@pytest.mark.parametrize("method", ["svm", ">cost", "gp>cost>rnd"])
def test_an_unknown_strategy_is_refused_with_the_known_ones(method: str) -> None:
    with pytest.raises(RequestError, match=r"choose one of rnd, cost, gp, .* as in gp>cost") as e:
        check_method(method)
    assert f"unknown method {method!r}" in str(e.value)


def test_what_learns_needs_a_library() -> None:
    with pytest.raises(RequestError, match="needs an experience library to learn from"):
        make_selector("rnd>gp")


def test_only_the_plain_name_has_lic2(columns: dict[str, np.ndarray]) -> None:
    both, first = make_selector("knn", columns), make_selector("knn1", columns)
    assert isinstance(both, LicSelector) and isinstance(first, LicSelector)
    assert first.second is None
    assert both.second is not None
    assert both.second.features.observed == (
        *("first_start_y", "first_start_phi"),
        *("first_final_x", "first_final_y"),
    )
    situation = Situation(p_WG=GOAL, starts=LINE)
    np.testing.assert_array_equal(both.select(situation).start.x0, first.select(situation).start.x0)


def test_one_strategy_makes_the_first_attempt_and_another_all_later_ones() -> None:
    selector = make_selector("rnd>cost")
    failed = tuple(FailedReach.from_start(Start(x0)) for x0 in LINE.grid.x0[:2])
    for n, method in enumerate(("rnd", "cost", "cost")):
        chosen = selector.select(Situation(p_WG=GOAL, starts=LINE, failed=failed[:n]))
        assert chosen.method == method


def test_behind_a_board_there_is_no_lic_2() -> None:
    rng, n = np.random.default_rng(0), 60
    columns = {name: rng.uniform(-0.4, 0.4, n) for name in ("goal_y", "goal_z", "start_y")}
    columns |= {"start_z": rng.uniform(-0.4, 0.4, n), "success": rng.random(n) < 0.5}
    columns |= {"environment": np.arange(n) // 6, "stream": np.full(n, "training")}
    columns["category"] = np.full(n, "sphere-aperture-clutter")
    selector = make_selector("knn", columns)
    assert isinstance(selector, LicSelector) and selector.second is None
