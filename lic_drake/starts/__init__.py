"""Feasible initial conditions (x0, b0) of an arm in an environment (paper Eqs. 3 and 4)."""

from dataclasses import replace

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Starts
from lic_drake.starts.board import BoardStarts as BoardStarts
from lic_drake.starts.feasible import FeasibleStarts as FeasibleStarts
from lic_drake.starts.feasible import Region as Region
from lic_drake.starts.feasible import find_regions as find_regions
from lic_drake.starts.line import LineStarts as LineStarts
from lic_drake.types import Vector


def make_starts(
    scenario: Scenario, instance: ClutterInstance, moves: bool = True
) -> LineStarts | BoardStarts:
    """Returns the initial conditions that are feasible in an environment of a scenario.

    Base and torso before a board may move as the task allows, or stay where they are. An arm in
    space without a board of apertures is a ScenarioError.
    """
    if scenario.arm().is_planar:
        return line_starts(scenario, instance)
    return board_starts(scenario, instance, moves)


def line_starts(scenario: Scenario, instance: ClutterInstance) -> LineStarts:
    """Returns the starts of an arm in the plane: on a line, or at apertures from a track."""
    task, starts = scenario.task, LineStarts(robot=scenario.arm(), line=scenario.task.start_line)
    if task.base is None or instance.p_WA is None:
        return starts
    return replace(starts, track=task.base, p_WA=instance.p_WA)


def board_starts(
    scenario: Scenario, instance: ClutterInstance, moves: bool = False, b0: Vector | None = None
) -> BoardStarts:
    """Returns the starts of an arm in space at the open apertures of an environment.

    Base and torso may move as the task allows, or are at b0, by default as the task has it. An arm
    in the plane, or an environment without a board, is a ScenarioError.
    """
    board = isinstance(scenario.clutter, ApertureBoard) and instance.p_WA is not None
    if scenario.arm().is_planar or not board:
        raise ScenarioError(
            "starts in apertures need an arm in space, as pr2, and a board of apertures, as in"
            f" sphere-aperture-clutter; {scenario.category} with {scenario.robot} has other starts"
        )
    stand = scenario.task.stand
    low = high = scenario.task.b0 if b0 is None else b0
    if moves and stand is not None:
        low = np.array([0.0, stand.y_min_m, stand.torso_min_m])
        high = np.array([0.0, stand.y_max_m, stand.torso_max_m])
    return BoardStarts(scenario=scenario, instance=instance, b0_lower=low, b0_upper=high)


def training_starts(scenario: Scenario, stream: str, environment: int) -> Starts:
    """Returns the starts that a collection tries in an environment."""
    instance = scenario.sample_instance(stream, environment)
    return make_starts(scenario, instance).training(stream, environment)
