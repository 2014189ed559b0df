"""The robot's belief about board, apertures and goal before each attempt, from its cameras."""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.board import ApertureBoard
from lic_drake.errors import PerceptionError, ScenarioError
from lic_drake.perception.apertures import DetectedApertures, find_apertures
from lic_drake.perception.cameras import Views, take_views
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.goal import DetectedGoal, find_goal
from lic_drake.perception.image import CameraImage, disturbed_image
from lic_drake.reach.request import ReachRecord
from lic_drake.reach.scenario import Scenario
from lic_drake.seeds import make_generator
from lic_drake.starts import BoardStarts, FeasibleStarts, board_starts
from lic_drake.types import Vector

LEAST_PROBABILITY = 0.5
"""Apertures whose probability of being open is lower are treated as blocked."""


class Belief(NamedTuple):
    """The robot's belief about the board, the apertures and the goal.

    Attributes:
        head: The image from the PR2's head, with its errors, in which it detected the apertures.
        external: The image from the other camera, in which it detected the goal.
        starts: The initial conditions at the apertures that are believed open.
        open_index: Indices of these apertures in `apertures`, shape (k,).
    """

    head: CameraImage
    external: CameraImage
    apertures: DetectedApertures
    goal: DetectedGoal
    starts: BoardStarts
    open_index: NDArray[np.intp]

    def over_all(self, values: Vector) -> Vector:
        """Returns values of the open apertures, shape (k,), with NaN for all others, shape (n,)."""
        all_values = np.full(len(self.apertures.p_WA), np.nan)
        all_values[self.open_index] = values
        return all_values


@dataclass(kw_only=True)
class Observer:
    """A PR2 that observes one environment before every attempt, and caches its beliefs.

    Images are rendered once; each look has its own errors.

    Attributes:
        stream: Seed stream of the environment, and of the cameras' errors.
        p_WG: True position of the ball, shape (3,), metres.
        moves: Whether base and torso may move.
    """

    scenario: Scenario
    stream: str
    environment: int
    p_WG: Vector
    cameras: CamerasConfig
    moves: bool = True
    _views: Views | None = field(default=None, init=False, repr=False)
    _beliefs: dict[int, Belief] = field(default_factory=dict, init=False, repr=False)

    def __call__(self, number: int) -> tuple[Vector, FeasibleStarts]:
        """Returns the believed p_WG, shape (3,), metres, and starts before an attempt, from 0."""
        belief = self.belief(number)
        return belief.goal.p_WG, belief.starts

    def belief(self, number: int) -> Belief:
        """Returns the belief before an attempt, from 0.

        Raises:
            RenderingError: Cameras cannot be simulated on this machine.
            PerceptionError: The board or the ball is not in view, or no aperture looks open.
        """
        if number not in self._beliefs:
            self._beliefs[number] = self._observe(number)
        return self._beliefs[number]

    def _observe(self, number: int) -> Belief:
        scenario, cameras = self.scenario, self.cameras
        if self._views is None:
            instance = scenario.sample_instance(self.stream, self.environment)
            self._views = take_views(instance, self.p_WG, cameras)
        make_rng = partial(make_generator, self.stream, "camera errors", self.environment)
        head = disturbed_image(self._views.head, cameras.head.camera, make_rng(2 * number))
        external = disturbed_image(
            self._views.external, cameras.external.camera, make_rng(2 * number + 1)
        )
        apertures = find_apertures(head, cameras.head.camera, board_of(scenario))
        goal = find_goal(external, cameras.external.camera, cameras.ball_radius_m)
        return Belief(head, external, apertures, goal, *starts_at(scenario, apertures, self.moves))

    def touches_ball(self, record: ReachRecord) -> bool:
        """Returns whether a reach that came to its believed goal ended inside the ball."""
        end = np.array([record.final_x, record.final_y, record.final_z])
        distance = float(np.linalg.norm(end - self.p_WG))
        return record.success and distance <= self.cameras.ball_radius_m


def board_of(scenario: Scenario) -> ApertureBoard:
    """Returns the board of a scenario; a `ScenarioError` says that it has none."""
    board = scenario.clutter
    if not isinstance(board, ApertureBoard):
        raise ScenarioError(f"{scenario.category} has no board; use foliage-aperture-clutter")
    return board


def starts_at(
    scenario: Scenario, found: DetectedApertures, moves: bool = True
) -> tuple[BoardStarts, NDArray[np.intp]]:
    """Returns the starts at the apertures that look open, and the indices of these apertures.

    The robot knows the size of the board and of its bars, and that the board is upright and
    perpendicular to x; where the board is, and what is open, it has seen.

    Raises:
        PerceptionError: No aperture looks open, or the board is at an impossible place.
    """
    board = board_of(scenario)
    index = np.flatnonzero(found.probability_open > LEAST_PROBABILITY)
    if len(index) == 0:
        raise PerceptionError(
            f"none of {len(found.p_WA)} apertures looks open; look again, or from another place"
        )
    try:
        seen = replace(board, board_centre=found.p_WA.mean(axis=0).tolist())
    except ScenarioError as error:
        raise PerceptionError(f"the board was seen at an impossible place: {error}") from None
    # `board_of` has checked that the scenario's clutter is a board.
    believed = replace(scenario, clutter=seen)  # type: ignore[arg-type]
    covered = np.delete(np.arange(len(found.p_WA)), index)
    starts = board_starts(believed, seen.blocked_board(covered), moves)
    return replace(starts, probability_open=found.probability_open[index]), index
