"""sphere-aperture-clutter: floating spheres behind a board (paper IV-B)."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance, join, make_objects, place_discs
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError

_MAX_SPHERES = 1000
"""More are too slow to simulate."""


@dataclass(kw_only=True)
class SphereApertureClutter(ApertureBoard):
    """Parameters of the category.

    Number, radius, mass, box and apertures are the paper's. It does not state their distance from
    the robot: `models/scenarios/sphere-aperture-clutter.yaml` says how that was chosen.
    """

    num_spheres: int = 40
    radius_m: float = 0.05
    mass_kg: float = 0.1
    # Box for the spheres' centres, (x, y, z) in W, metres.
    lower: list[float] = field(default_factory=lambda: [0.59, -0.64, 0.69])
    upper: list[float] = field(default_factory=lambda: [0.78, 0.06, 1.09])

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(
            self,
            positive=["radius_m", "mass_kg"],
            ranges={"num_spheres": (0, _MAX_SPHERES)},
            vectors={"lower": 3, "upper": 3},
            ascending=[("lower", "upper")],
        )
        if self.lower[0] - self.radius_m < self.board_back_m:
            raise ScenarioError(
                f"spheres from x = {self.lower[0] - self.radius_m:.3f} m would overlap the board at"
                f" {self.board_centre[0]} m; raise lower or move board_centre"
            )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples an environment; its spheres do not depend on `num_blocked`."""
        n = self.num_spheres
        centres = place_discs(rng, n, self.lower, self.upper, 2.0 * self.radius_m)
        spheres = make_objects("sphere", [self.radius_m], centres, mass=self.mass_kg, movable=True)
        order = rng.permutation(self.rows * self.columns)
        board = self.blocked_board(np.sort(order[: self.num_blocked]))
        return join(spheres, board, p_WA=board.p_WA)
