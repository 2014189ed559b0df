"""Where a robot in space may start: the tool in the centre of an aperture, pointing in (IV-B)."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RequestError, ScenarioError
from lic_drake.reach.scenario import Scenario
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_inverse import ROBOT_TO_CLUTTER, calc_preselection_cost, solve_pointing
from lic_drake.robots.registry import get_robot
from lic_drake.scene.collision import CollisionChecker
from lic_drake.scene.scene import SceneConfig

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PointingStarts:
    """One initial condition for each open aperture that the arm can point into.

    The redundant arm has one pre-selected configuration there: of those in which it touches
    neither board nor body the one of least cost, Eq. (5).

    Attributes:
        aperture: Indices into the environment's apertures, shape (n,).
        x0: Tool poses (x, y, z, qw, qx, qy, qz) in W, shape (n, 7).
        q: Joint angles, shape (n, 7), radians.
        p_WR: Where the base stands, shape (2,), metres.
        torso_m: Height of the torso, metres.
    """

    aperture: NDArray[np.intp]
    x0: Vector
    q: Vector
    p_WR: Vector
    torso_m: float

    def draw(self, rng: np.random.Generator, failed: NDArray[np.intp] | None = None) -> int:
        """Draws one of them, all equally likely: the paper's strategy RND.

        Args:
            rng: Source of the draw.
            failed: Indices of those that have been tried.

        Returns:
            Its index, 0 to n - 1.

        Raises:
            RequestError: None is left.
        """
        left = np.setdiff1d(np.arange(len(self.x0)), [] if failed is None else failed)
        if len(left) == 0:
            raise RequestError("the arm can point into no aperture that has not been tried")
        return int(left[rng.integers(len(left))])


def find_pointing_starts(
    scenario: Scenario,
    instance: ClutterInstance,
    p_WR: Vector | None = None,
    torso_m: float | None = None,
) -> PointingStarts:
    """Returns the initial conditions at the open apertures of an environment.

    Args:
        scenario: The scenario.
        instance: The environment.
        p_WR: Where the base stands, shape (2,), metres; by default at the origin.
        torso_m: Height of the torso, metres; by default as the scenario's task has it.

    Raises:
        ScenarioError: The robot cannot point, or the environment has no apertures.
    """
    torso_m = scenario.task.torso_m if torso_m is None else torso_m
    if not isinstance(scenario.arm(torso_m), Pr2Arm) or instance.p_WA is None:
        raise ScenarioError(
            "starts that point into apertures need the robot pr2 and apertures;"
            f" {scenario.category} with {scenario.robot} has other starts"
        )
    base = np.zeros(2) if p_WR is None else p_WR
    boxes = ~instance.movable
    angles = _find_angles(
        scenario.robot,
        torso_m,
        _rows(instance.p_WA - [*base, 0.0]),
        _rows(np.hstack([instance.p_WO[boxes] - [*base, 0.0], instance.size[boxes]])),
    )
    arm = scenario.arm(torso_m)
    found = [(i, np.array(q)) for i, q in enumerate(angles) if q is not None]
    x0 = np.array([arm.tip_pose(q) for _, q in found]).reshape(-1, 7)
    x0[:, :2] += base
    return PointingStarts(
        aperture=np.array([i for i, _ in found], dtype=np.intp),
        x0=x0 + 0.0,  # No negative zeros: they would make another key of the same start.
        q=np.array([q for _, q in found]).reshape(-1, 7),
        p_WR=base,
        torso_m=torso_m,
    )


@lru_cache(maxsize=64)
def _find_angles(
    robot: str,
    torso_m: float,
    p_RA: tuple[tuple[float, ...], ...],
    boxes: tuple[tuple[float, ...], ...],
) -> tuple[tuple[float, ...] | None, ...]:
    """Returns joint angles for each aperture, or None; all environments have the same board.

    Args:
        robot: Its name.
        torso_m: Height of its torso, metres.
        p_RA: Centres of the apertures in the robot's frame, metres.
        boxes: Position and edges of each box of the board, metres.
    """
    arm = get_robot(robot).raised(torso_m)
    assert isinstance(arm, Pr2Arm)
    checker = CollisionChecker(arm, _board(np.array(boxes).reshape(-1, 6)), SceneConfig())
    angles: list[tuple[float, ...] | None] = []
    for p_RE in np.array(p_RA).reshape(-1, 3):
        q = solve_pointing(arm.kinematics, p_RE, ROBOT_TO_CLUTTER)
        q = q[np.argsort(calc_preselection_cost(arm.kinematics, q), kind="stable")]
        free = next((row for row in q if not checker.touches(row)), None)
        angles.append(None if free is None else tuple(free.tolist()))
    return tuple(angles)


def _board(boxes: Vector) -> ClutterInstance:
    n = len(boxes)
    return ClutterInstance(
        category="board",
        shape=("box",) * n,
        size=boxes[:, 3:],
        p_WO=boxes[:, :3],
        yaw=np.zeros(n),
        mass=np.ones(n),
        movable=np.zeros(n, dtype=bool),
    )


def _rows(values: Vector) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, values.tolist()))
