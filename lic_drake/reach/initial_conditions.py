"""`InitialConditions`: hand poses x0, with the base and torso b0 that carry the arm (Eq. 3)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lic_drake.types import Vector


@dataclass(frozen=True)
class InitialConditions:
    """n initial conditions: hand poses x0 and what carries the arm, b0.

    Attributes:
        x0: Hand poses (x, y, phi) in W, shape (n, 3), metres and radians; in space position and
            quaternion, shape (n, 7).
        p_WR: Positions of the base in the plane, shape (n, 2), metres.
        torso_m: Heights of the torso, shape (n,), metres; by default 0, for robots without one.
    """

    x0: Vector
    p_WR: Vector
    torso_m: Vector = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        if len(self.torso_m) == 0:
            object.__setattr__(self, "torso_m", np.zeros(len(self.x0)))

    def __len__(self) -> int:
        return len(self.x0)

    @property
    def b0(self) -> Vector:
        """The base's position and the torso's height, shape (n, 3), metres."""
        return np.column_stack([self.p_WR, self.torso_m])

    @property
    def in_R(self) -> Vector:
        """The hand poses in the robot's frame, which b0 carries; as x0."""
        x0_R = self.x0.copy()
        x0_R[:, :3] -= self.b0
        return x0_R

    def take(self, which: NDArray[np.generic]) -> "InitialConditions":
        """Returns some of them, by a mask or by indices."""
        return InitialConditions(self.x0[which], self.p_WR[which], self.torso_m[which])

    def join(self, other: "InitialConditions") -> "InitialConditions":
        """Returns these followed by others."""
        return InitialConditions(
            np.vstack([self.x0, other.x0]),
            np.vstack([self.p_WR, other.p_WR]),
            np.concatenate([self.torso_m, other.torso_m]),
        )
