"""Where a robot in space may start: the tool in the centre of an aperture, pointing in (IV-B)."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance, make_objects
from lic_drake.errors import RequestError, ScenarioError
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.reach.task import Stand
from lic_drake.robots.arm import Arm
from lic_drake.robots.registry import get_robot
from lic_drake.scene.collision import CollisionChecker
from lic_drake.scene.scene import SceneConfig
from lic_drake.types import Vector

ROBOT_TO_CLUTTER = np.array([1.0, 0.0, 0.0])
"""The paper's x: from the robot to the clutter."""

STEP_M = (0.1, 0.05)
"""Distances of neighbouring places of the base and heights of the torso in the grid, metres."""

TOLERANCE = 1e-6
"""A base, torso or tool this near to where it may be, metres, counts as there."""


@dataclass(frozen=True, kw_only=True)
class PointingStarts:
    """Initial conditions at the open apertures of an environment.

    The redundant arm has one pre-selected configuration for each: of those in which it touches
    neither board nor body the one of least cost, Eq. (5).

    Attributes:
        scenario: The scenario; its robot is the PR2.
        instance: The environment.
        stand: Where base and torso may be.
        probability_open: How likely each open aperture really is open, shape (k,); None where that
            is certain.
    """

    scenario: Scenario
    instance: ClutterInstance
    stand: Stand
    probability_open: Vector | None = None

    @property
    def p_WA(self) -> Vector:
        """Centres of the open apertures, shape (k, 3), metres."""
        assert self.instance.p_WA is not None
        return self.instance.p_WA

    def chance(self, x0: Vector) -> Vector:
        """Returns how likely the apertures of n tool poses, shape (n, 7), are open, shape (n,)."""
        if self.probability_open is None:
            return np.ones(len(x0))
        apart = np.linalg.norm(x0[:, None, :3] - self.p_WA, axis=2)
        return self.probability_open[np.argmin(apart, axis=1)]

    def nearest_aperture(self, y_m: float, z_m: float) -> Vector:
        """Returns the centre of the open aperture at a place in the board, shape (3,), metres.

        Raises:
            RequestError: There is none.
        """
        distance = np.linalg.norm(self.p_WA[:, 1:] - [y_m, z_m], axis=1)
        p_WA: Vector = self.p_WA[np.argmin(distance)]
        if not distance.min() <= 0.5 * self.aperture_m:
            raise RequestError(
                f"there is no open aperture at y {y_m} m, z {z_m} m; the nearest is at y"
                f" {p_WA[1]:.3f} m, z {p_WA[2]:.3f} m"
            )
        return p_WA

    @property
    def all_apertures(self) -> Vector:
        """Centres of all apertures, open or blocked, shape (n, 3), metres."""
        p_WA = self._bare_board.p_WA
        assert p_WA is not None
        return p_WA

    @property
    def aperture_m(self) -> float:
        """Distance of neighbouring apertures' centres, metres."""
        apart = np.linalg.norm(self.all_apertures[1:] - self.all_apertures[0], axis=1)
        return float(apart.min())

    @cached_property
    def _bare_board(self) -> ClutterInstance:
        assert isinstance(self.scenario.clutter, ApertureBoard)
        return self.scenario.clutter.bare_board()

    @cached_property
    def checker(self) -> CollisionChecker:
        """The mobile robot in front of the board."""
        return CollisionChecker(self.scenario.arm(), self.instance, self.scenario.scene)

    @property
    def grid(self) -> Starts:
        """All open apertures, from places of the base and heights of the torso in equal steps."""
        return self._table[0]

    @property
    def grid_angles(self) -> Vector:
        """The joint angles of the grid, shape (n, 7), radians."""
        return self._table[1]

    def angles(self, x0: Vector, p_WR: Vector, torso_m: float) -> Vector | None:
        """Returns the joint angles of an initial condition, shape (7,), None if there are none.

        Args:
            x0: Tool pose in W, shape (7,).
            p_WR: Base, shape (2,), metres.
            torso_m: Height of the torso, metres.
        """
        stand = self.stand
        if not (
            stand.y_min_m - TOLERANCE <= p_WR[1] <= stand.y_max_m + TOLERANCE
            and stand.torso_min_m - TOLERANCE <= torso_m <= stand.torso_max_m + TOLERANCE
            and abs(p_WR[0]) <= TOLERANCE
            and np.min(np.linalg.norm(self.p_WA - x0[:3], axis=1)) <= TOLERANCE
        ):
            return None
        b0 = np.append(p_WR, torso_m)
        return self.checker.first_free(b0, self.scenario.arm().solve_ik(Start(x0, b0).x0_R))

    def pre_select(self, p_WA: Vector, b0: Vector) -> tuple[Vector, Vector] | None:
        """Returns the initial condition at an aperture that Eq. (5) prefers, None if there is none.

        Args:
            p_WA: Centre of an open aperture, shape (3,), metres.
            b0: Place of the base and height of the torso, shape (3,), metres.

        Returns:
            Tool pose in W, shape (7,), and joint angles, shape (7,), radians.
        """
        return next(_pre_select(self.scenario.arm(), self.checker, p_WA[None], b0))

    @cached_property
    def _table(self) -> tuple[Starts, Vector]:
        bare, stand = self._bare_board, self.stand
        conditions, q = _preselect(
            self.scenario.robot,
            _rows(np.hstack([bare.p_WO, bare.size])),
            _rows(self.all_apertures),
            _steps(stand.y_min_m, stand.y_max_m, STEP_M[0]),
            _steps(stand.torso_min_m, stand.torso_max_m, STEP_M[1]),
        )
        if len(self.p_WA) == len(self.all_apertures):
            return conditions, q
        apart = np.linalg.norm(conditions.x0[:, None, :3] - self.p_WA, axis=2).min(axis=1)
        free = np.array(
            [
                near <= TOLERANCE and not self.checker.touches(b0, row)
                for near, b0, row in zip(apart, conditions.b0, q, strict=True)
            ]
        )
        return conditions.take(free), q[free]


def pointing_starts(
    scenario: Scenario, instance: ClutterInstance, stand: Stand | None = None
) -> PointingStarts:
    """Returns the initial conditions at the open apertures of an environment.

    Args:
        scenario: The scenario.
        instance: The environment.
        stand: Where base and torso may be; by default they do not move.

    Raises:
        ScenarioError: The robot cannot point, or the environment has no apertures.
    """
    if (
        scenario.arm().is_planar
        or instance.p_WA is None
        or not isinstance(scenario.clutter, ApertureBoard)
    ):
        raise ScenarioError(
            "starts that point into apertures need a robot in space and a board of apertures;"
            f" {scenario.category} with {scenario.robot} has other starts"
        )
    return PointingStarts(
        scenario=scenario,
        instance=instance,
        stand=stand or standing_at(0.0, scenario.task.torso_m),
    )


def standing_at(y_m: float, torso_m: float) -> Stand:
    """Returns one place of the base and one height of the torso, metres."""
    return Stand(
        y_min_m=y_m,
        y_max_m=y_m,
        torso_min_m=torso_m,
        torso_max_m=torso_m,
        training_y_m=[y_m],
        training_torso_m=[torso_m],
    )


@lru_cache(maxsize=64)
def _preselect(
    robot: str,
    boxes: tuple[tuple[float, ...], ...],
    p_WA: tuple[tuple[float, ...], ...],
    places: tuple[float, ...],
    heights: tuple[float, ...],
) -> tuple[Starts, Vector]:
    """Returns the initial conditions of a board, n, and their joint angles, shape (n, 7).

    All environments have the same board, but for what is blocked.

    Args:
        robot: Name of the robot.
        boxes: Position and edges of each of its bars, metres.
        p_WA: Centres of the apertures, metres.
        places: Places of the base, y, metres.
        heights: Heights of the torso, metres.
    """
    p_WO, edges = np.hsplit(np.array(boxes), 2)
    board = make_objects("box", edges, p_WO)
    arm = get_robot(robot)
    checker = CollisionChecker(arm, board, SceneConfig())
    x0, bases, angles = [], [], []
    for y_m, torso_m in product(places, heights):
        b0 = np.array([0.0, y_m, torso_m])
        for found in _pre_select(arm, checker, np.array(p_WA), b0):
            if found is not None:
                x0.append(found[0])
                bases.append(b0)
                angles.append(found[1])
    conditions = Starts(np.array(x0).reshape(-1, 7), np.array(bases).reshape(-1, 3))
    return conditions, np.array(angles).reshape(-1, 7)


def _pre_select(
    arm: Arm, checker: CollisionChecker, p_WA: Vector, b0: Vector
) -> Iterator[tuple[Vector, Vector] | None]:
    """Yields what Eq. (5) prefers at each aperture; see `PointingStarts.pre_select`."""
    for p_WE, q in zip(p_WA, arm.solve_pointing(p_WA - b0, ROBOT_TO_CLUTTER), strict=True):
        free = checker.first_free(b0, q)
        if free is None:
            yield None
            continue
        pose = arm.tip_pose(free)
        # Exactly the centre, and no negative zeros: they would make another key of the same start.
        pose[:3] = p_WE
        yield pose + 0.0, free


def _steps(low: float, high: float, step: float) -> tuple[float, ...]:
    """Returns numbers from low to high, both included, apart by at most a step."""
    count = int(np.ceil((high - low) / step - 1e-9)) + 1
    return tuple(np.round(np.linspace(low, high, count), 6).tolist())


def _rows(values: Vector) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, values.tolist()))
