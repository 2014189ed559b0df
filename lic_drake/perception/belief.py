"""From what was seen to where the robot may start: the board as the robot believes it to be."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import PerceptionError, ScenarioError
from lic_drake.perception.apertures import BoardModel, DetectedApertures
from lic_drake.perception.lookout import Look
from lic_drake.reach.pointing_starts import PointingStarts, pointing_starts
from lic_drake.reach.scenario import Scenario
from lic_drake.types import Vector

LEAST_PROBABILITY = 0.5
"""An aperture that is less likely open is taken for blocked."""


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What the robot takes its surroundings for.

    Attributes:
        look: What it saw.
        p_WG: Where it takes the goal to be, shape (3,), metres.
        starts: The initial conditions at the apertures that it takes for open.
        index: Which of the board's apertures they are, shape (k,), as `DetectedApertures` has them.
    """

    look: Look
    p_WG: Vector
    starts: PointingStarts
    index: NDArray[np.intp]

    def over_all(self, values: Vector) -> Vector:
        """Returns values of the open apertures, shape (k,), with NaN for all others, shape (n,)."""
        all_values = np.full(len(self.look.apertures.p_WA), np.nan)
        all_values[self.index] = values
        return all_values


def board_of(scenario: Scenario) -> tuple[ApertureBoard, BoardModel]:
    """Returns the board of a scenario, and what perception may know of it.

    Raises:
        ScenarioError: It has none.
    """
    board = scenario.clutter
    if not isinstance(board, ApertureBoard):
        raise ScenarioError(f"{scenario.category} has no board; use foliage-aperture-clutter")
    return board, BoardModel(rows=board.rows, columns=board.columns, aperture_m=board.aperture_m)


def believe(scenario: Scenario, look: Look, moves: bool = True) -> Belief:
    """Returns what the robot believes after a look.

    It knows the size of the board and of its bars, and that the board is upright and across x;
    where the board is and what is open it saw.

    Args:
        scenario: Gives the size of the board, the robot, and where base and torso may be.
        look: What was seen.
        moves: Whether base and torso may move.

    Raises:
        PerceptionError: No aperture looks open, or the board is not where one could be.
    """
    board, _ = board_of(scenario)
    found = look.apertures
    index = np.flatnonzero(found.probability_open > LEAST_PROBABILITY)
    if len(index) == 0:
        raise PerceptionError(
            f"none of {len(found.p_WA)} apertures looks open; look again, or from another place"
        )
    try:
        seen = replace(board, board_centre=found.p_WA.mean(axis=0).tolist())
    except ScenarioError as error:
        raise PerceptionError(f"the board was seen where it cannot be: {error}") from None
    # A scenario's clutter is a board here, as `board_of` has checked.
    believed = replace(scenario, clutter=seen)  # type: ignore[arg-type]
    return Belief(
        look=look,
        p_WG=look.goal.p_WG,
        starts=_starts(believed, seen, found, index, moves),
        index=index,
    )


def _starts(
    believed: Scenario,
    board: ApertureBoard,
    found: DetectedApertures,
    index: NDArray[np.intp],
    moves: bool,
) -> PointingStarts:
    stand = believed.task.stand if moves else None
    starts = pointing_starts(believed, _with_covers(board, index), stand)
    return replace(starts, probability_open=found.probability_open[index])


def _with_covers(board: ApertureBoard, index: NDArray[np.intp]) -> ClutterInstance:
    """Returns a board with a cover in all apertures but some, as thick as its bars."""
    bare, p_WA = board.bare_board(), board.aperture_centres()
    covered = np.delete(p_WA, index, axis=0)
    k, edge = len(covered), board.aperture_m
    return replace(
        bare,
        shape=bare.shape + ("box",) * k,
        size=np.vstack([bare.size, np.tile([board.bar_m, edge, edge], (k, 1))]),
        p_WO=np.vstack([bare.p_WO, covered]),
        yaw=np.zeros(len(bare.yaw) + k),
        mass=np.ones(len(bare.mass) + k),
        movable=np.zeros(len(bare.movable) + k, dtype=bool),
        p_WA=p_WA[index],
    )
