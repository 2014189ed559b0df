from dataclasses import replace

import numpy as np
import pytest
from support.fake_reach import make_record

from lic_drake.evaluate.trial import run_trial
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario, load_scenario
from lic_drake.select.baselines import RandomSelector
from lic_drake.select.situation import Selection, Situation

GOAL = np.array([0.6, 0.1, 0.0])
LINE = load_scenario("cylinder-clutter")
APERTURES = load_scenario("cylinder-aperture-clutter")
BOTH = pytest.mark.parametrize("scenario", [LINE, APERTURES], ids=["line", "apertures"])


class Watched:
    """A random strategy that records its situations."""

    method = "watched"

    def __init__(self) -> None:
        self.situations: list[Situation] = []
        self.random = RandomSelector(rng=np.random.default_rng(2))

    def select(self, situation: Situation) -> Selection:
        self.situations.append(situation)
        return self.random.select(situation)


def failing(request: ReachRequest) -> ReachRecord:
    return replace(make_record(request), success=False)


@BOTH
def test_a_trial_ends_with_its_first_success_or_its_last_attempt(scenario: Scenario) -> None:
    for first_success in (1, 2, 3, 9):
        numbers = iter(range(1, 10))

        def reach(request: ReachRequest, numbers=numbers, success=first_success) -> ReachRecord:
            return replace(make_record(request), success=next(numbers) == success)

        done = run_trial(scenario, Watched(), "evaluation", 5, GOAL, 4, reach=reach)
        assert len(done) == min(first_success, 4)
        won = [attempt.record.success for attempt in done]
        assert won == [i == first_success for i in range(1, len(done) + 1)]


@BOTH
def test_attempts_follow_each_other_from_selected_starts_that_answer_failures(
    scenario: Scenario,
) -> None:
    selector = Watched()
    done = run_trial(scenario, selector, "evaluation", 5, GOAL, 3, reach=failing)
    for attempt in done:
        request, chosen = attempt.request, attempt.selection
        assert (request.stream, request.environment) == ("evaluation", 5)
        np.testing.assert_array_equal(request.goal, GOAL)
        np.testing.assert_array_equal(request.start.x0, chosen.start.x0)
        np.testing.assert_array_equal(request.start.b0, chosen.start.b0)
        assert attempt.record.key == request.key
    before = [attempt.request.before() for attempt in done]
    assert before == [None, done[0].request, done[1].request]
    # The apertures are those of the environment.
    for situation in selector.situations:
        p_WA = scenario.sample_instance("evaluation", 5).p_WA
        np.testing.assert_array_equal(situation.starts.p_WA, p_WA)
    assert [len(situation.failed) for situation in selector.situations] == [0, 1, 2]
    for failed, attempt in zip(selector.situations[-1].failed, done[:2], strict=True):
        np.testing.assert_array_equal(failed.start.x0, attempt.selection.start.x0)
        np.testing.assert_array_equal(failed.shown["final_x"], attempt.record.final_x)
        np.testing.assert_array_equal(failed.shown["final_vy"], attempt.record.final_vy)
