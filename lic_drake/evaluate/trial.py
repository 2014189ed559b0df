"""A trial: attempts at one goal in one environment until one succeeds (paper VI-A)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach
from lic_drake.seeds import make_generator
from lic_drake.select.registry import Selector
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.starts import FeasibleStarts, make_starts
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A selection and the reach from it."""

    selection: Selection
    request: ReachRequest
    record: ReachRecord


def run_trial(
    scenario: Scenario,
    selector: Selector,
    stream: str,
    environment: int,
    p_WG: Vector,
    attempts: int,
    *,
    fresh: bool = False,
    moves: bool = True,
    reach: Callable[[ReachRequest], ReachRecord] = run_reach,
    look: Callable[[int], tuple[Vector, FeasibleStarts]] | None = None,
) -> list[Attempt]:
    """Selects and reaches until the goal is reached or the attempts are used up.

    Args:
        scenario: Category, robot and rules.
        selector: The strategy.
        stream: Seed stream of the environment.
        environment: Its index.
        p_WG: Goal, shape (3,), metres.
        attempts: Maximum number of reaches.
        fresh: Whether the environment is reset before every attempt; otherwise it stays as the
            previous attempt left it, as on a real robot.
        moves: Whether a PR2 may move base and torso before a reach.
        reach: Simulates a request.
        look: Returns the perceived goal and the starts believed feasible before the attempt with
            this number, from 0; both are known by default. If the perceived goal has changed, the
            environment is reset.
    """
    if look is None:
        known = make_starts(scenario, scenario.sample_instance(stream, environment), moves)

        def look(_: int) -> tuple[Vector, FeasibleStarts]:
            return p_WG, known

    done: list[Attempt] = []
    for number in range(attempts):
        p_seen, starts = look(number)
        failed = tuple(FailedReach.from_record(attempt.record) for attempt in done)
        selection = selector.select(Situation(p_WG=p_seen, starts=starts, failed=failed))
        if done and not fresh and np.array_equal(p_seen, done[-1].request.goal):
            request = done[-1].request.then(selection.start)
        else:
            request = ReachRequest(scenario, stream, environment, p_seen, selection.start)
        done.append(Attempt(selection=selection, request=request, record=reach(request)))
        if done[-1].record.success:
            break
    return done


def random_requests(
    scenario: Scenario, stream: str, environments: int, goals: int
) -> list[ReachRequest]:
    """Returns reaches from random starts of the grid to random goals: RND's first attempts.

    Args:
        scenario: The scenario.
        stream: Seed stream of environments, goals and starts.
        environments: Number of environments, from index 0.
        goals: Number of reaches in each, to as many goals unless the environment has one goal.
    """
    requests = []
    for environment in range(environments):
        instance = scenario.sample_instance(stream, environment)
        starts = make_starts(scenario, instance).grid.without_q()
        for goal in range(goals):
            index = 0 if scenario.task.goal_area is None else goal
            p_WG = scenario.sample_goal(stream, environment, index)
            rng = make_generator(stream, "rnd", environment, goal)
            start = starts[int(rng.integers(len(starts)))]
            requests.append(ReachRequest(scenario, stream, environment, p_WG, start))
    return requests
