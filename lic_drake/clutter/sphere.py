"""sphere-aperture-clutter: floating spheres behind a board with square apertures (paper IV-B)."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.placement import place_discs
from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

MAX_SPHERES = 1000
"""More spheres are refused: the simulation would not finish in useful time."""


@dataclass(kw_only=True)
class SphereApertureClutter(ApertureBoard):
    """Parameters of the category: those of the board and of the spheres behind it.

    Numbers, radius, mass, box and apertures are the paper's. It does not state how far all this
    is from the robot: `models/scenarios/sphere-aperture-clutter.yaml` says how that was chosen.
    """

    num_spheres: int = 40
    radius_m: float = 0.05
    mass_kg: float = 0.1
    # Box for the spheres' centres, (x, y, z) in W, metres.
    lower: list[float] = field(default_factory=lambda: [0.59, -0.64, 0.69])
    upper: list[float] = field(default_factory=lambda: [0.78, 0.06, 1.09])

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.num_spheres <= MAX_SPHERES:
            raise ScenarioError(f"num_spheres must be from 0 to {MAX_SPHERES}: {self.num_spheres}")
        for name in ("radius_m", "mass_kg"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ScenarioError(f"{name} must be a positive number, got {value}")
        for name in ("lower", "upper"):
            value = getattr(self, name)
            if len(value) != 3 or not np.all(np.isfinite(value)):
                raise ScenarioError(f"{name} must be [x, y, z] in metres, got {value}")
        if not np.all(np.array(self.lower) < self.upper):
            raise ScenarioError(f"lower {self.lower} must be below upper {self.upper} in x, y, z")
        if self.lower[0] - self.radius_m < self.board_back_m:
            raise ScenarioError(
                f"spheres from x = {self.lower[0] - self.radius_m:.3f} m on would stand in the"
                f" board at {self.board_centre[0]} m; raise lower or move board_centre"
            )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment: uniform centres without overlap, and then what is blocked.

        The spheres of an environment do not depend on how many apertures are blocked.

        Raises:
            ScenarioError: The spheres do not fit into the box.
        """
        n = self.num_spheres
        centres = place_discs(
            rng, n, np.array(self.lower), np.array(self.upper), 2.0 * self.radius_m
        )
        p_WA = self.aperture_centres()
        blocked = np.sort(rng.permutation(len(p_WA))[: self.num_blocked])
        p_WB, edges = self._board(p_WA[blocked])
        k = len(p_WB)
        return ClutterInstance(
            category="sphere-aperture-clutter",
            shape=(*("sphere",) * n, *("box",) * k),
            size=np.vstack([np.tile([self.radius_m, 0.0, 0.0], (n, 1)), edges]),
            p_WO=np.vstack([centres, p_WB]),
            yaw=np.zeros(n + k),
            mass=np.append(np.full(n, self.mass_kg), np.ones(k)),
            movable=np.arange(n + k) < n,
            p_WA=np.delete(p_WA, blocked, axis=0),
        )

    def _board(self, p_WA: Vector) -> tuple[Vector, Vector]:
        """Returns centres and edges of the board's boxes, each shape (k, 3), metres.

        Args:
            p_WA: Centres of the blocked apertures, shape (num_blocked, 3), metres.
        """
        p_WB, edges = self.bar_boxes()
        cover = [self.bar_m, self.aperture_m, self.aperture_m]
        return np.vstack([p_WB, p_WA]), np.vstack([edges, np.tile(cover, (len(p_WA), 1))])
