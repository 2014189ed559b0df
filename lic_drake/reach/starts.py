"""Which initial conditions, hand pose x0 and base b0, are possible (paper Eqs. 3 and 4)."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RequestError
from lic_drake.reach.hand_poses import HandPoses
from lic_drake.reach.pointing_starts import pointing_starts, standing_at
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import Starts as StartBatch
from lic_drake.reach.task import BaseTrack, StartLine
from lic_drake.robots.registry import get_robot
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

TOLERANCE = 1e-6
"""A base or a hand this near to its bounds, in metres, counts as inside."""


@dataclass(frozen=True, kw_only=True)
class Region:
    """A box of initial conditions; joint limits apart, all of it is possible.

    Attributes:
        lower: Lower bounds of x0, shape (3,), in W, metres and radians.
        upper: Upper bounds of x0, shape (3,).
        base_lower: Lower bounds of the base, shape (2,), metres.
        base_upper: Upper bounds of the base, shape (2,).
    """

    lower: Vector
    upper: Vector
    base_lower: Vector
    base_upper: Vector

    def holds(self, x0: Vector, p_WR: Vector, tolerance: float = TOLERANCE) -> bool:
        """Tells whether an initial condition, shapes (3,) and (2,), lies in the box."""
        return bool(
            np.all(x0 >= self.lower - tolerance)
            and np.all(x0 <= self.upper + tolerance)
            and np.all(p_WR >= self.base_lower - tolerance)
            and np.all(p_WR <= self.base_upper + tolerance)
        )


class Starts(Protocol):
    """The initial conditions that a robot can choose from in an environment."""

    @property
    def grid(self) -> StartBatch:
        """The discrete ones, from which RND and COST choose."""
        ...

    def angles(self, x0: Vector, p_WR: Vector, torso_m: float) -> Vector | None:
        """Returns joint angles with which the robot can start so, shape (m,), else None.

        Args:
            x0: Hand pose in W, shape (3,), or (7,) in space.
            p_WR: Base, shape (2,), metres.
            torso_m: Height of the torso, metres; 0 for a robot without one.
        """
        ...


class PlanarStarts(Starts, Protocol):
    """Those of a planar arm.

    Attributes:
        poses: The hand poses that the arm can take, in R.
    """

    @property
    def poses(self) -> HandPoses:
        """The hand poses that the arm can take, in R."""
        ...

    @property
    def regions(self) -> tuple[Region, ...]:
        """Boxes that hold all initial conditions."""
        ...

    @property
    def lattice(self) -> StartBatch:
        """A denser set than the grid."""
        ...


def find_region(regions: Sequence[Region], x0: Vector, p_WR: Vector) -> Region | None:
    """Returns the region that holds an initial condition, up to the rounding of grids, if any."""
    return next((region for region in regions if region.holds(x0, p_WR, 1e-5)), None)


def is_possible(starts: PlanarStarts, x0: Vector, p_WR: Vector) -> bool:
    """Tells whether a planar arm can start so; uses the closed-form inverse kinematics.

    Args:
        starts: The possible initial conditions.
        x0: Hand pose in W, shape (3,).
        p_WR: Base, shape (2,), metres.
    """
    inside = any(region.holds(x0, p_WR) for region in starts.regions)
    return inside and starts.poses.contains(x0 - [*p_WR, 0.0])


def _planar_angles(starts: PlanarStarts, x0: Vector, p_WR: Vector) -> Vector | None:
    """Returns the joint angles of a planar arm that starts so, None if it cannot."""
    if not is_possible(starts, x0, p_WR):
        return None
    q: Vector = starts.poses.arm.solve_ik(x0 - [*p_WR, 0.0])[0]
    return q


@dataclass(frozen=True, kw_only=True)
class LineStarts:
    """A fixed base: the hand starts anywhere on the start line; satisfies `PlanarStarts`."""

    poses: HandPoses

    @property
    def regions(self) -> tuple[Region, ...]:
        """The line."""
        line, zeros = self.poses.line, np.zeros(2)
        return (Region(lower=line.lower, upper=line.upper, base_lower=zeros, base_upper=zeros),)

    @cached_property
    def grid(self) -> StartBatch:
        """The poses of the line's grid."""
        return StartBatch(self.poses.grid, np.zeros((len(self.poses.grid), 3)))

    @cached_property
    def lattice(self) -> StartBatch:
        """Poses 0.025 m and 7.5 degrees apart."""
        return StartBatch(self.poses.lattice, np.zeros((len(self.poses.lattice), 3)))

    def angles(self, x0: Vector, p_WR: Vector, torso_m: float = 0.0) -> Vector | None:
        """Returns joint angles with which the arm can start so, else None; see `Starts`."""
        return _planar_angles(self, x0, p_WR)


@dataclass(frozen=True, kw_only=True)
class ApertureStarts:
    """A mobile base: the hand starts in the centre of an aperture; satisfies `PlanarStarts`.

    Attributes:
        poses: Hand poses relative to the base.
        track: Where the base may stand.
        p_WA: Centres of the apertures, shape (k, 3), metres.
    """

    poses: HandPoses
    track: BaseTrack
    p_WA: Vector

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """One an aperture: the orientation and the base are free."""
        line = self.poses.line
        return tuple(
            Region(
                lower=np.array([x, y, line.lower[2]]),
                upper=np.array([x, y, line.upper[2]]),
                base_lower=np.array([x - line.x_m, max(self.track.y_min_m, y - line.y_max_m)]),
                base_upper=np.array([x - line.x_m, min(self.track.y_max_m, y - line.y_min_m)]),
            )
            for x, y, _ in self.p_WA
        )

    @cached_property
    def grid(self) -> StartBatch:
        """The poses of the line's grid, each at every aperture if the track allows it."""
        return self._at_apertures(self.poses.grid)

    @cached_property
    def lattice(self) -> StartBatch:
        """As `grid`, 0.025 m and 7.5 degrees apart or denser."""
        return self._at_apertures(self.poses.lattice)

    def angles(self, x0: Vector, p_WR: Vector, torso_m: float = 0.0) -> Vector | None:
        """Returns joint angles with which the arm can start so, else None; see `Starts`."""
        return _planar_angles(self, x0, p_WR)

    def draw(self, rng: np.random.Generator, per_aperture: int) -> StartBatch:
        """Draws uniformly among the possible ones, the same number at each aperture.

        Raises:
            RequestError: The arm reaches an aperture from nowhere on the track.
        """
        found = StartBatch(np.empty((0, 3)), np.empty((0, 3)))
        for region in self.regions:
            for _ in range(per_aperture):
                found = found.join(self._draw_one(rng, region))
        return found

    def _draw_one(self, rng: np.random.Generator, region: Region) -> StartBatch:
        for _ in range(10_000):
            x0 = rng.uniform(region.lower, region.upper)
            p_WR = rng.uniform(region.base_lower, np.maximum(region.base_lower, region.base_upper))
            if self.poses.contains(x0 - [*p_WR, 0.0]):
                return StartBatch(x0[None], np.array([[*p_WR, 0.0]]))
        raise RequestError(
            f"the arm reaches the aperture at y = {region.lower[1]:.3f} m from nowhere on its"
            " track; widen task.base or the orientations of task.start_line"
        )

    def _at_apertures(self, poses: Vector) -> StartBatch:
        found = StartBatch(np.empty((0, 3)), np.empty((0, 3)))
        for x, y, _ in self.p_WA:
            p_WR = np.array([x, y]) - poses[:, :2]
            x0 = np.column_stack([np.tile([x, y], (len(poses), 1)), poses[:, 2]])
            low, high = self.track.y_min_m - TOLERANCE, self.track.y_max_m + TOLERANCE
            on_track = (p_WR[:, 1] >= low) & (p_WR[:, 1] <= high)
            # Rounding must not make one base two.
            b0 = np.column_stack([np.round(p_WR, 12), np.zeros(len(p_WR))])
            found = found.join(StartBatch(x0, b0).take(on_track))
        return found


def make_starts(scenario: Scenario, instance: ClutterInstance, moves: bool = True) -> Starts:
    """Returns the initial conditions that are possible in an environment of a scenario.

    Args:
        scenario: The scenario.
        instance: The environment.
        moves: Whether a PR2 may move its base and torso as the task allows; without, they stay
            where they are.
    """
    if not scenario.arm().is_planar:
        return pointing_starts(scenario, instance, scenario.task.stand if moves else None)
    return planar_starts(scenario, instance)


def planar_starts(scenario: Scenario, instance: ClutterInstance) -> LineStarts | ApertureStarts:
    """Returns the initial conditions of a planar arm in an environment of a scenario."""
    poses, track = _poses(scenario), scenario.task.base
    if track is None or instance.p_WA is None:
        return LineStarts(poses=poses)
    return ApertureStarts(poses=poses, track=track, p_WA=instance.p_WA)


def training_starts(scenario: Scenario, stream: str, environment: int) -> StartBatch:
    """Returns the initial conditions that a collection tries in an environment.

    They are one for each aperture for a robot in space (paper IV-B), the grid of a fixed base
    (paper IV-A), and random ones at each aperture for a mobile base, whose grid would be far larger
    than the paper's 15 reaches an environment.
    """
    if not scenario.arm().is_planar:
        stand = scenario.task.stand
        place = (0.0, scenario.task.torso_m) if stand is None else stand.for_training(environment)
        instance = scenario.sample_instance(stream, environment)
        return pointing_starts(scenario, instance, standing_at(*place)).grid
    if scenario.task.base is None:
        return LineStarts(poses=_poses(scenario)).grid
    starts = planar_starts(scenario, scenario.sample_instance(stream, environment))
    if isinstance(starts, LineStarts):
        return starts.grid
    return starts.draw(
        make_generator(stream, "starts", environment), starts.track.starts_per_aperture
    )


def _poses(scenario: Scenario) -> HandPoses:
    return _hand_poses(scenario.robot, tuple(asdict(scenario.task.start_line).items()))


@lru_cache(maxsize=16)
def _hand_poses(robot: str, line: tuple[tuple[str, float], ...]) -> HandPoses:
    """Returns the poses of a robot and the values of a start line; they take a second to find."""
    return HandPoses(arm=get_robot(robot), line=StartLine(**dict(line)))
