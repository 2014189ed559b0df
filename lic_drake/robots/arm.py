"""What the other rooms ask of a robot arm."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, ModelInstanceIndex

from lic_drake.types import Vector

if TYPE_CHECKING:
    from lic_drake.robots.skin_shape import SkinShape


@dataclass(frozen=True, kw_only=True)
class SkinCapsule:
    """A capsule of the arm's surface.

    Attributes:
        link: Name of the body that carries it.
        radius: Metres.
        length: Length of the cylindrical part, metres.
        R_LC: Rotation of the capsule frame C (axis along Cz) in the link frame, shape (3, 3).
        p_LC: Position of the capsule's centre in the link frame, shape (3,), metres.
    """

    link: str
    radius: float
    length: float
    R_LC: Vector
    p_LC: Vector


class Arm(Protocol):
    """An arm with an impedance controller and a skin; all vectors are in its base frame R.

    Attributes:
        name: Name in scenario files.
        link_names: Names of the bodies that carry skin, proximal to distal.
        q_min: Lower joint limits, shape (m,), radians.
        q_max: Upper joint limits, shape (m,), radians.
        stiffness: Joint stiffness of the impedance controller, shape (m,), Nm/rad.
        p_RS: The point about which the whole arm turns, shape (3,), metres.
        reach_m: Largest distance of the tip from it, metres.
        torso_m: Height of the torso that carries it, metres; 0 without one.
        torso_frame: Name of the plant's frame whose position along its parent's z is that height;
            empty without a torso.
        skin: The surface of the arm, as capsules or by capsules around it.
    """

    name: str
    link_names: tuple[str, ...]
    q_min: Vector
    q_max: Vector
    stiffness: Vector
    p_RS: Vector
    reach_m: float
    torso_m: float
    torso_frame: str
    skin: tuple[SkinCapsule, ...]

    @property
    def surface(self) -> "tuple[SkinShape, ...] | None":
        """The surface itself where its shapes are not capsules."""
        ...

    def raised(self, torso_m: float) -> "Arm":
        """Returns the arm on a torso of this height, metres.

        Raises:
            ScenarioError: The robot's torso cannot go there.
        """
        ...

    def add_to_plant(
        self, plant: MultibodyPlant, parent: Frame | None = None
    ) -> ModelInstanceIndex:
        """Adds the arm with its joint impedance, its base welded to a frame, else to the world."""
        ...

    def solve_ik(self, x0: Vector) -> Vector | None:
        """Returns the configuration for the hand pose x0, shape (m,), or None."""
        ...

    def start_angles(self, x0: Vector) -> Vector:
        """Returns the configurations for the hand pose x0, shape (n, m), those to prefer first.

        Which of them touch anything is not looked at.
        """
        ...

    def tip_pose(self, q: Vector) -> Vector:
        """Returns the hand pose x0 of the configuration q."""
        ...

    def tip_position(self, q: Vector) -> Vector:
        """Returns p_RE, shape (3,), metres."""
        ...

    def tip_jacobian(self, q: Vector) -> Vector:
        """Returns Jv_v_RE, shape (3, m), m/rad."""
        ...

    def link_poses(self, q: Vector) -> tuple[Vector, Vector]:
        """Returns R_RL, shape (k, 3, 3), and p_RL, shape (k, 3), of the skin links."""
        ...

    def point_jacobians(self, q: Vector, links: NDArray[np.intp], p_RQ: Vector) -> Vector:
        """Returns Jv_v_RQ of points Q on skin links, shape (n, 3, m), m/rad.

        Args:
            q: Joint angles, shape (m,), radians.
            links: Index into `link_names` of each point's link, shape (n,).
            p_RQ: Positions of the points, shape (n, 3), metres.
        """
        ...
