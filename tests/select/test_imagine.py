"""Environments that agree with what was felt, and starts that are tried in them."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.made_up import planar_library
from support.worlds import ARM

from lic_drake.errors import RequestError
from lic_drake.evaluate.trial import Attempt, random_requests, run_trial
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.reach.sleeping import SkinAxes
from lic_drake.select import imagine as module
from lic_drake.select.felt import OVERLAP_M, Felt
from lic_drake.select.imagine import imagine, imagined_environments, race
from lic_drake.select.registry import make_selector
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts

SCENARIO = load_scenario("cylinder-clutter")
RADIUS = SCENARIO.clutter.radius_m


def draws(first: int) -> Iterator[np.ndarray]:
    for index in range(first, first + 1000):
        yield SCENARIO.sample_instance("imagination", index).p_WO


@pytest.mark.parametrize("seed", range(5))
def test_imagined_objects_are_where_some_were_felt_and_not_where_the_arm_was(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axes = SkinAxes(ARM)
    q = ARM.q_min + rng.uniform(0.3, 0.7, (8, 3)) * (ARM.q_max - ARM.q_min)
    felt = Felt(
        still=np.array([[0.8, 0.3], [0.8, -0.5]]),
        pushed=np.array([[0.9, 0.0]]),
        axes=axes,
        ends=tuple(axes.ends(row) for row in q),
    )
    movable = SCENARIO.sample_instance("training", 0).movable
    loose = np.ones(len(movable), dtype=bool)
    p_WO = imagine(draws(1000 * seed), loose, movable, RADIUS, felt)
    for centre, kind in ((felt.still, ~movable), (felt.pushed, movable)):
        apart = np.linalg.norm(p_WO[kind, np.newaxis, :2] - centre, axis=2)
        assert np.all(apart.min(axis=0) == 0.0)
    placed = np.isin(p_WO[:, :2], np.vstack([felt.still, felt.pushed])).all(axis=1)
    assert placed.sum() == 3
    assert felt.gaps(p_WO[~placed, :2]).min() >= RADIUS - OVERLAP_M
    apart = np.linalg.norm(p_WO[:, np.newaxis] - p_WO, axis=2) + np.eye(len(p_WO))
    assert apart.min() >= 2.0 * RADIUS
    # Most objects are as they were drawn.
    first = next(draws(1000 * seed))
    assert np.mean(np.all(p_WO == first, axis=1)) > 0.7


def test_dense_clutter_is_imagined_without_overlaps() -> None:
    scenario = load_scenario("sphere-aperture-clutter")
    radius, arm = scenario.clutter.radius_m, scenario.arm()
    instance = scenario.sample_instance("training", 0)
    loose = np.array([shape == "sphere" for shape in instance.shape])
    axes = SkinAxes(arm, 3)
    q = arm.q_home + np.zeros((1, len(arm.q_min)))
    ends = axes.ends(q[0]) + scenario.task.b0[:, np.newaxis]
    pushed = np.array([[0.7, -0.3, 0.9], [0.68, -0.1, 0.8]])
    felt = Felt(still=np.array([[0.7, -0.5, 0.9]]), pushed=pushed, axes=axes, ends=(ends,))
    draws = (scenario.sample_instance("imagination", i).p_WO for i in range(100))
    p_WO = imagine(draws, loose, instance.movable, radius, felt)[loose]
    # Where all can yield, one that did not is among them.
    for centre in (*felt.still, *pushed):
        assert np.min(np.linalg.norm(p_WO - centre, axis=1)) == 0.0
    apart = np.linalg.norm(p_WO[:, np.newaxis] - p_WO, axis=2) + np.eye(len(p_WO))
    assert apart.min() >= 2.0 * radius
    assert np.count_nonzero(p_WO[:, 0] > 1.0) <= 4  # So many may have found no room.


def test_the_best_alternative_is_found_with_few_trials() -> None:
    chance = np.array([0.9, 0.1, 0.5, 0.3, 0.2, 0.8, 0.0, 0.4, 0.4, 0.1, 0.2, 0.3])
    wrong = np.full(12, 0.5)  # Nothing is known before.
    found, tried = [], 0
    for seed in range(40):
        rng = np.random.default_rng(seed)

        def reaches(environment: int, k: int) -> bool:
            nonlocal tried
            tried += 1
            return bool(rng.uniform() < chance[k])  # noqa: B023

        best, share = race(wrong, range(1000), reaches)
        assert 0.0 < share < 1.0
        found.append(best)
    assert tried == 40 * sum(keep * further for keep, further in module.ROUNDS)
    assert np.mean(chance[found]) > 0.75


def fail(scenario: Scenario, environment: int = 0) -> tuple[Situation, Attempt]:
    """A first attempt of COST that cannot succeed in time, and the situation after it."""
    p_WG = scenario.sample_goal("holdout", environment, 0)
    cost = make_selector("cost")
    (attempt,) = run_trial(scenario, cost, "holdout", environment, p_WG, attempts=1)
    starts = make_starts(scenario, scenario.sample_instance("holdout", environment))
    failed = (FailedReach.from_record(attempt.record, attempt.request),)
    return Situation(p_WG=p_WG, starts=starts, failed=failed), attempt


def test_a_further_attempt_is_chosen_in_imagined_environments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ROUNDS", ((3, 1), (2, 1)))
    category = "cylinder-aperture-clutter"
    scenario = load_scenario(category, "{stop: {timeout_s: 0.3}}")
    library = planar_library(tmp_path / "library", scenario)
    situation, attempt = fail(scenario)
    said: list[str] = []
    learned = (library.columns(), None, said.append)
    answers = [make_selector("imagine", *learned).select(situation) for _ in range(2)]
    assert [line for line in said if "imagining" in line] == [
        "imagining the clutter from what was felt: 5 reaches ..."
    ] * 2
    assert answers[0].method == "imagine" and 0.0 <= (answers[0].probability or -1.0) <= 1.0
    assert answers[0].start == answers[1].start != attempt.request.start
    # What is fixed around the objects is known, nothing else.
    real = scenario.sample_instance("holdout", 0)
    environment = next(imagined_environments([attempt.request]))
    boxes = np.array([shape == "box" for shape in real.shape])
    np.testing.assert_array_equal(environment.p_WO[boxes], real.p_WO[boxes])
    assert not np.any(np.all(np.isclose(environment.p_WO, real.p_WO), axis=1) & ~boxes)


def test_what_cannot_be_imagined_is_refused() -> None:
    scenario = load_scenario("passage-clutter", "{stop: {timeout_s: 0.2}}")
    (request,) = random_requests(scenario, "holdout", 1, 1)
    with pytest.raises(RequestError, match="not for passage-clutter; choose gp or knn"):
        next(imagined_environments([request]))
    situation, _ = fail(load_scenario("cylinder-clutter", "{stop: {timeout_s: 0.2}}"))
    unknown = replace(situation.failed[0], request=None)
    with pytest.raises(RequestError, match="only where they began and ended is known"):
        module.requests_of(replace(situation, failed=(unknown,)))
