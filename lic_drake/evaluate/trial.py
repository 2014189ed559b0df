"""A trial: attempts at one goal in one environment until one succeeds (paper VI-A)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.reach.request import ReachRecord, ReachRequest, make_request
from lic_drake.reach.rollout import run_reach
from lic_drake.reach.scenario import Scenario
from lic_drake.robots.planar import PlanarArm
from lic_drake.select.registry import Selector
from lic_drake.select.situation import Selection, Situation, StartSet


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """A selection and the reach from it."""

    selection: Selection
    request: ReachRequest
    record: ReachRecord


def planar_arm_of(scenario: Scenario) -> PlanarArm:
    """Returns the scenario's robot, which must be a planar arm.

    Raises:
        RequestError: It is another robot.
    """
    arm = scenario.arm()
    if not isinstance(arm, PlanarArm):
        raise RequestError(f"selection knows the planar arm only, not {scenario.robot!r}")
    return arm


def run_trial(
    scenario: Scenario,
    selector: Selector,
    stream: str,
    environment: int,
    p_WG: NDArray[np.float64],
    attempts: int,
) -> list[Attempt]:
    """Selects and reaches until the goal is reached or the attempts are used up.

    Every attempt finds the environment as it was drawn; later attempts keep away from the starts
    that failed.

    Args:
        scenario: Category, robot and rules.
        selector: The strategy.
        stream: Seed stream of the environment.
        environment: Its index.
        p_WG: Goal, shape (3,), metres.
        attempts: How many reaches at the most.
    """
    starts = StartSet(arm=planar_arm_of(scenario), line=scenario.task.start_line)
    done: list[Attempt] = []
    for _ in range(attempts):
        failed = tuple(attempt.selection.x0 for attempt in done)
        selection = selector.select(Situation(p_WG=p_WG, starts=starts, failed=failed))
        request = make_request(scenario, stream, environment, p_WG, selection.x0)
        done.append(Attempt(selection=selection, request=request, record=run_reach(request)))
        if done[-1].record.success:
            break
    return done
