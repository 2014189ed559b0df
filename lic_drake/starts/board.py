"""Starts of an arm in space: the hand in the centre of an aperture, pointing in (paper IV-B)."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RequestError
from lic_drake.kept import Arrays, keep, kept_path, read_kept
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Start, Starts
from lic_drake.robots.arm import Arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.starts.feasible import TOLERANCE, Effort, FeasibleStarts, Region
from lic_drake.types import Vector

GRID_M = (0.1, 0.05)
"""Distances of neighbouring bases and of heights of the torso in the grid, metres."""
LATTICE_M = 0.025
"""Largest distance of neighbouring bases and heights of the torso in the lattice, metres."""
# Starts from so many bases and more are kept; of the training stand there is one.
_KEPT_FROM = 10
_PACKAGE = Path(__file__).parents[1]
_CODE = sorted(
    path
    for room in ("clutter", "robots", "scene", "starts")
    for path in (_PACKAGE / room).glob("*.py")
)
# The way from the robot into the clutter, along which the hand points.
_INTO_CLUTTER = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class BoardStarts(FeasibleStarts):
    """Starts at the open apertures of a board, from wherever base and torso may be.

    A redundant arm has one preferred configuration for each: the cheapest by Eq. (5) of those in
    which it touches neither the board nor the robot's body.

    Attributes:
        scenario: The scenario, with an arm in space and a board of apertures.
        instance: The environment.
        b0_lower: Lower bounds of base and torso, shape (3,), metres; x is fixed.
        b0_upper: Their upper bounds.
        probability_open: How likely each open aperture really is open, shape (k,), if uncertain.
    """

    scenario: Scenario
    instance: ClutterInstance
    b0_lower: Vector
    b0_upper: Vector
    probability_open: Vector | None = None

    effort = Effort(solves=100, solves_per_region=1, max_gain=0.06)

    @property
    def arm(self) -> Arm:
        """The robot."""
        return self.scenario.arm()

    @property
    def p_WA(self) -> Vector:
        """Centres of the open apertures, shape (k, 3), metres."""
        assert self.instance.p_WA is not None
        return self.instance.p_WA

    @property
    def board(self) -> ApertureBoard:
        """The board with all its apertures, open or blocked."""
        assert isinstance(self.scenario.clutter, ApertureBoard)
        return self.scenario.clutter

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """One for each open aperture: base, torso and the roll of the hand are free."""
        # Turns about Wx are quaternions (cos, sin, 0, 0) of half the angle.
        return tuple(
            Region(
                lower=np.array([*p_WA, 0.0, -1.0, 0.0, 0.0]),
                upper=np.array([*p_WA, 1.0, 1.0, 0.0, 0.0]),
                b0_lower=self.b0_lower,
                b0_upper=self.b0_upper,
            )
            for p_WA in self.p_WA
        )

    @property
    def home(self) -> Vector:
        """Base and torso where the task has them, shape (3,), metres."""
        return self.scenario.task.b0

    @cached_property
    def checker(self) -> CollisionChecker:
        """The mobile robot before the board."""
        return CollisionChecker(self.arm, self.instance)

    @cached_property
    def grid(self) -> Starts:
        """All open apertures, from bases and heights of the torso in equal steps."""
        y, torso = (self._steps(axis, GRID_M[axis - 1]).tolist() for axis in (1, 2))
        b0 = tuple((float(self.b0_lower[0]), *place) for place in product(y, torso))
        board = self.board
        key = (tuple(board.board_centre), board.columns, board.rows, board.aperture_m, board.bar_m)
        found = _preferred_before_bare_board(self.arm, key, b0)
        if len(self.p_WA) == len(self.board.aperture_centres()):
            return found
        assert found.q is not None
        apart = np.linalg.norm(found.x0[:, None, :3] - self.p_WA, axis=2).min(axis=1)
        free = [
            near <= TOLERANCE and not self.checker.touches(place, q)
            for near, place, q in zip(apart, found.b0, found.q, strict=True)
        ]
        return found.take(np.array(free))

    def lattice(self, values: Vector) -> Starts:
        """Returns bases and torso heights within the bounds, with the best hand of each aperture.

        They include those that see an aperture where the library has one: an L1 kernel has its
        kinks there, and a Gaussian process its peaks.
        """
        found = self.grid.take(np.zeros(0, dtype=int))
        stand = self.scenario.task.stand
        learned = ([], []) if stand is None else (stand.training_y_m, stand.training_torso_m)
        for p_WA in self.p_WA:
            here = np.all(np.isclose(self.grid.x0[:, :3], p_WA), axis=1)
            if np.all(values[here] == -np.inf):
                continue
            x0 = self.grid.x0[np.flatnonzero(here)[np.argmax(values[here])]]
            apart = (x0[:3] - self.board.aperture_centres()).T[1:]
            y, torso = (
                self._steps(axis, LATTICE_M, np.add.outer(apart[axis - 1], learned[axis - 1]))
                for axis in (1, 2)
            )
            b0 = np.array([[self.b0_lower[0], *place] for place in product(y, torso)])
            found = found.join(Starts(np.tile(x0, (len(b0), 1)), b0))
        return found

    def solve(self, x0: Vector, b0: Vector, near: Vector | None = None) -> Vector | None:
        """See `FeasibleStarts.solve`."""
        if not any(region.holds(x0, b0) for region in self.regions):
            return None
        x0_R = Start(x0, b0).x0_R
        return self.checker.first_free(b0, self.arm.solve_ik(x0_R, near))

    def nearest(self, x0: Vector, b0: Vector) -> Start | None:
        """Returns what Eq. (5) prefers in the aperture of a hand pose or position, else None."""
        (found,) = _preferred(self.arm, self.checker, x0[None, :3], b0)
        return found

    def chance(self, x0: Vector) -> Vector:
        """Returns how likely the apertures of n hand poses are open, shape (n,)."""
        if self.probability_open is None:
            return np.ones(len(x0))
        apart = np.linalg.norm(x0[:, None, :3] - self.p_WA, axis=2)
        return self.probability_open[np.argmin(apart, axis=1)]

    def training(self, stream: str, environment: int) -> Starts:
        """Returns one for each aperture, from the environment's place of the training stand."""
        b0, stand = self.home, self.scenario.task.stand
        if stand is not None:
            b0[1:] = stand.for_training(environment)
        return replace(self, b0_lower=b0, b0_upper=b0).grid.without_q()

    def nearest_aperture(self, y_m: float, z_m: float) -> Vector:
        """Returns the centre of the open aperture at a place in the board; RequestError if none."""
        distance = np.linalg.norm(self.p_WA[:, 1:] - [y_m, z_m], axis=1)
        p_WA: Vector = self.p_WA[np.argmin(distance)]
        if not distance.min() <= 0.5 * self.board.aperture_m:
            raise RequestError(
                f"there is no open aperture at y {y_m} m, z {z_m} m; the nearest is at y"
                f" {p_WA[1]:.3f} m, z {p_WA[2]:.3f} m"
            )
        return p_WA

    def _steps(self, axis: int, step_m: float, more: ArrayLike = ()) -> Vector:
        """Returns b0 along an axis, at most a step apart, and those of more numbers between."""
        low, high = self.b0_lower[axis], self.b0_upper[axis]
        count = int(np.ceil((high - low) / step_m - 1e-9)) + 1
        more = np.ravel(more)
        inside = more[(more > low) & (more < high)]
        # What is equal but for rounding is one place.
        return np.unique(np.round(np.append(np.linspace(low, high, count), inside), 6))


@lru_cache(maxsize=64)
def _preferred_before_bare_board(
    arm: Arm, board: tuple[Any, ...], b0: tuple[tuple[float, ...], ...]
) -> Starts:
    """Returns what Eq. (5) prefers in each aperture from each base, where there is anything.

    All environments of a scenario have the same board, but for what is blocked. An arm without a
    closed form takes seconds, once: what it finds is kept.
    """
    path = None
    if len(b0) >= _KEPT_FROM:
        identity = (arm.digest, arm.skin, board, b0, version("drake"))
        kinematics = (arm.q_min, arm.q_max, *arm.calc_pose(arm.q_home))
        path = kept_path("starts", _CODE, identity, kinematics)
    if path is not None and (kept := read_kept(path, _as_starts, "starts")) is not None:
        return kept
    centre, columns, rows, aperture_m, bar_m = board
    bare = ApertureBoard(
        board_centre=list(centre), columns=columns, rows=rows, aperture_m=aperture_m, bar_m=bar_m
    ).bare_board()
    assert bare.p_WA is not None
    checker = CollisionChecker(arm, bare)
    found = [
        start
        for place in b0
        for start in _preferred(arm, checker, bare.p_WA, np.array(place))
        if start is not None
    ]
    x0 = np.array([start.x0 for start in found]).reshape(-1, 7)
    q = np.array([start.q for start in found]).reshape(-1, len(arm.q_min))
    starts = Starts(x0, np.array([start.b0 for start in found]).reshape(-1, 3), q)
    if path is not None:
        keep(path, {"x0": x0, "b0": starts.b0, "q": q}, "starts")
    return starts


def _as_starts(arrays: Arrays) -> Starts:
    """Returns starts that were kept."""
    x0, b0, q = (arrays[name] for name in ("x0", "b0", "q"))
    if (x0.shape, b0.shape, q.ndim) != ((len(q), 7), (len(q), 3), 2):
        raise ValueError("its arrays have other shapes")
    if not all(np.all(np.isfinite(array)) for array in (x0, b0, q)):
        raise ValueError("its arrays are not finite")
    return Starts(x0, b0, q)


def _preferred(
    arm: Arm, checker: CollisionChecker, p_WA: Vector, b0: Vector
) -> Iterator[Start | None]:
    """Yields what Eq. (5) prefers in each of k apertures, shape (k, 3), from a base."""
    for p_WE, angles in zip(p_WA, arm.solve_pointing(p_WA - b0, _INTO_CLUTTER), strict=True):
        q = checker.first_free(b0, angles)
        # Exactly the centre; of the pose only the roll is left to the arm.
        yield None if q is None else Start(np.append(p_WE, arm.tip_pose(q)[3:]), b0, q)
