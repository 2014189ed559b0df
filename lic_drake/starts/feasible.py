"""`FeasibleStarts`: what all families of initial conditions offer, whatever the robot."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from lic_drake.reach.start import Start, Starts
from lic_drake.robots.arm import Arm
from lic_drake.scene.collision import CollisionChecker
from lic_drake.starts.region import Region
from lic_drake.types import Vector


class Effort(NamedTuple):
    """How thoroughly a selection searches among feasible starts.

    Attributes:
        solves: Number of candidates from which the program is solved.
        solves_per_region: The same in each region.
        max_gain: A region is skipped if its best candidate is this much below the best so far.
    """

    solves: int = 6
    solves_per_region: int = 6
    max_gain: float = np.inf


class FeasibleStarts(ABC):
    """The initial conditions (x0, b0) that are feasible for an arm in an environment (Eqs. 3, 4).

    Attributes:
        effort: How a selection searches among them.
    """

    effort = Effort()

    @property
    @abstractmethod
    def arm(self) -> Arm:
        """The robot."""

    @property
    @abstractmethod
    def regions(self) -> tuple[Region, ...]:
        """Boxes that hold all of them."""

    @property
    @abstractmethod
    def grid(self) -> Starts:
        """The discrete ones with their joint angles, from which RND and COST choose."""

    @abstractmethod
    def lattice(self, values: Vector) -> Starts:
        """Returns denser candidates than the grid, feasible or not.

        Args:
            values: Estimates at the grid, shape (n,), -inf for what is not to be considered.
        """

    @abstractmethod
    def solve(self, x0: Vector, b0: Vector, near: Vector | None = None) -> Vector | None:
        """Returns joint angles with which the arm can start so, shape (m,), else None.

        Args:
            x0: Hand pose in W, shape (3,), or (7,) in space.
            b0: Base and torso, shape (3,), metres.
            near: Joint angles that the result is to be near to, shape (m,), radians; by default it
                is the arm's first choice.
        """

    @abstractmethod
    def training(self, stream: str, environment: int) -> Starts:
        """Returns those that a collection tries in the environment; joint angles are left open."""

    @property
    def checker(self) -> CollisionChecker | None:
        """The mobile robot and what it must keep away from; None if no start comes near it."""
        return None

    @property
    def home(self) -> Vector | None:
        """Base and torso from which the robot prefers not to move, shape (3,), metres, if any."""
        return None

    def chance(self, x0: Vector) -> Vector:
        """Returns the probability that n hand poses are feasible, shape (n,); 1 by default."""
        return np.ones(len(x0))

    def nearest(self, x0: Vector, b0: Vector) -> Start | None:
        """Returns the preferred start with this hand position from this base, None if none is."""
        q = self.solve(x0, b0)
        return None if q is None else Start(x0, b0, q)

    def snap(self, region: Region, start: Start) -> Start | None:
        """Returns the nearest feasible start to where an optimisation ended, None if none is near.

        Base and torso are rounded to the micrometre unless that takes a joint beyond its limit; the
        joint angles follow.

        Args:
            region: The region in which the optimisation was.
            start: Where it ended, perhaps beside the region.
        """
        for b0 in (np.round(start.b0, 6), start.b0):
            x0, b0 = region.clip(start.x0, b0)
            q = self.solve(x0, b0, near=start.q)
            if q is not None:
                return Start(x0, b0, q)
        return None
