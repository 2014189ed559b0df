"""`Start` and `Starts`: where a reach begins, hand pose x0, base and torso b0, joint angles q."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import RequestError
from lic_drake.types import Vector

IN_PLANE, IN_SPACE = 3, 7
"""Numbers of a hand pose: (x, y, phi) in the plane, position and quaternion in space."""

POSE_AXES = {
    IN_PLANE: ("x", "y", "phi"),
    IN_SPACE: ("x", "y", "z", "qw", "qx", "qy", "qz"),
}
"""Names of the numbers of a hand pose, as in the columns of records."""


@dataclass(frozen=True, eq=False)
class Start:
    """The initial condition of a reach. Equal if all numbers are; hashable; arrays are read-only.

    Attributes:
        x0: Hand pose in W: in the plane (x, y, phi), shape (3,); in space position and quaternion
            (x, y, z, qw, qx, qy, qz), shape (7,). Metres and radians.
        b0: Position of the base and height of the torso, (x, y, torso), shape (3,), metres: the
            translation T_b0 of paper Eq. (3).
        q: Joint angles, shape (m,), radians. None: the reach begins in the first of the arm's
            configurations for x0 that touches nothing.

    Raises:
        RequestError: A number is not finite, or there are too few or too many.
    """

    x0: Vector
    b0: Vector = field(default_factory=lambda: np.zeros(3))
    q: Vector | None = None

    def __post_init__(self) -> None:
        # Adding zero makes -0.0 and 0.0 the same start with the same key.
        for name in ("x0", "b0", "q") if self.q is not None else ("x0", "b0"):
            value = np.array(getattr(self, name), dtype=float) + 0.0
            if not np.all(np.isfinite(value)):
                raise RequestError(
                    f"{name} of a start must be finite numbers, got {value.tolist()}"
                )
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        if self.x0.shape not in ((IN_PLANE,), (IN_SPACE,)) or self.b0.shape != (3,):
            raise RequestError(
                "a start has a hand pose of 3 numbers (x, y, phi) or 7 (position, quaternion) and a"
                f" base of 3 (x, y, torso height), got {self.x0.tolist()} and {self.b0.tolist()}"
            )

    @property
    def x0_R(self) -> Vector:
        """The hand pose in R, the frame that moves with b0; shape as x0."""
        return _shifted(self.x0[None], self.b0[None])[0]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Start) and self._bytes() == other._bytes()

    def __hash__(self) -> int:
        return hash(self._bytes())

    def _bytes(self) -> tuple[bytes | None, ...]:
        return tuple(None if x is None else x.tobytes() for x in (self.x0, self.b0, self.q))


@dataclass(frozen=True, eq=False)
class Starts:
    """n initial conditions: as in `Start`, with a row for each.

    A row of q is NaN where joint angles are left to the arm; q is None if they are all.
    """

    x0: Vector
    b0: Vector
    q: Vector | None = None

    @classmethod
    def of(cls, start: Start) -> "Starts":
        """Returns a batch of one."""
        return cls(start.x0[None], start.b0[None], None if start.q is None else start.q[None])

    def __len__(self) -> int:
        return len(self.x0)

    def __getitem__(self, index: int) -> Start:
        q = None if self.q is None or np.isnan(self.q[index, 0]) else self.q[index]
        return Start(self.x0[index], self.b0[index], q)

    def __iter__(self) -> Iterator[Start]:
        return (self[i] for i in range(len(self)))

    @property
    def in_R(self) -> Vector:
        """The hand poses in R, the frame that moves with b0; as x0."""
        return _shifted(self.x0, self.b0)

    def take(self, which: NDArray[np.generic]) -> "Starts":
        """Returns some of them, by a mask or by indices."""
        return Starts(self.x0[which], self.b0[which], None if self.q is None else self.q[which])

    def without_q(self) -> "Starts":
        """Returns them with the joint angles left to the arm."""
        return Starts(self.x0, self.b0)

    def join(self, other: "Starts") -> "Starts":
        """Returns these followed by others."""
        m = max(0 if some.q is None else some.q.shape[1] for some in (self, other))
        q = [np.full((len(x), m), np.nan) if x.q is None else x.q for x in (self, other)]
        return Starts(
            np.vstack([self.x0, other.x0]),
            np.vstack([self.b0, other.b0]),
            np.vstack(q) if m else None,
        )


def _shifted(x0: Vector, b0: Vector) -> Vector:
    """Returns n hand poses as seen from frames at b0, shape as x0."""
    x0_R = x0.copy()
    axes = 2 if x0.shape[1] == IN_PLANE else 3
    x0_R[:, :axes] -= b0[:, :axes]
    return x0_R


def describe_start(start: Start) -> str:
    """Returns a start in words."""
    x0, (x, y, torso) = start.x0, start.b0
    base = f", base at y {y:+.3f} m" if x or y else ""
    if len(x0) == IN_PLANE:
        return f"y {x0[1]:+.3f} m, phi {np.rad2deg(x0[2]):+.1f} degrees{base}"
    position = ", ".join(f"{value:.3f}" for value in x0[:3])
    return f"the aperture at ({position}) m{base}, torso at {torso:.3f} m"
