"""sphere-aperture-clutter: floating spheres behind a board with square apertures (paper IV-B)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.placement import place_discs
from lic_drake.errors import ScenarioError

MAX_SPHERES = 1000
"""More spheres are refused: the simulation would not finish in useful time."""
MAX_APERTURES = 20
"""A board with more rows or columns is refused."""


@dataclass(kw_only=True)
class SphereApertureClutter:
    """Parameters of the category.

    Numbers, radius, mass, box and apertures are the paper's. It does not state how far all this
    is from the robot: `models/scenarios/sphere-aperture-clutter.yaml` says how that was chosen.
    """

    num_spheres: int = 40
    radius_m: float = 0.05
    mass_kg: float = 0.1
    # Box for the spheres' centres, (x, y, z) in W, metres.
    lower: list[float] = field(default_factory=lambda: [0.58, -0.54, 0.74])
    upper: list[float] = field(default_factory=lambda: [0.77, 0.16, 1.14])
    # The board's centre in W, metres; it is upright, across x.
    board_centre: list[float] = field(default_factory=lambda: [0.5, -0.19, 0.94])
    columns: int = 5
    rows: int = 4
    # Distance of neighbouring apertures' centres, and width and thickness of the bars between
    # them, metres. The bars take their width from the apertures: with centres 0.2 m apart (paper
    # IV-B) there is no other room, and so do the poles of the authors' planar generator.
    aperture_m: float = 0.2
    bar_m: float = 0.02
    # So many apertures are blocked, at random.
    num_blocked: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.num_spheres <= MAX_SPHERES:
            raise ScenarioError(f"num_spheres must be from 0 to {MAX_SPHERES}: {self.num_spheres}")
        for name in ("radius_m", "mass_kg", "aperture_m", "bar_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ScenarioError(f"{name} must be a positive number, got {value}")
        for name in ("lower", "upper", "board_centre"):
            value = getattr(self, name)
            if len(value) != 3 or not np.all(np.isfinite(value)):
                raise ScenarioError(f"{name} must be [x, y, z] in metres, got {value}")
        if not np.all(np.array(self.lower) < self.upper):
            raise ScenarioError(f"lower {self.lower} must be below upper {self.upper} in x, y, z")
        for name in ("columns", "rows"):
            if not 1 <= getattr(self, name) <= MAX_APERTURES:
                raise ScenarioError(
                    f"{name} must be from 1 to {MAX_APERTURES}, got {getattr(self, name)}"
                )
        if self.bar_m >= self.aperture_m:
            raise ScenarioError(
                f"bars of {self.bar_m} m leave nothing of apertures of {self.aperture_m} m"
            )
        if not 0 <= self.num_blocked < self.rows * self.columns:
            raise ScenarioError(
                f"num_blocked must leave one of {self.rows * self.columns} apertures open,"
                f" got {self.num_blocked}"
            )
        if self.lower[0] - self.radius_m < self.board_centre[0] + 0.5 * self.bar_m:
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

    def bare_board(self) -> ClutterInstance:
        """Returns the board alone with no aperture blocked: all that is known beforehand."""
        p_WA = self.aperture_centres()
        p_WB, edges = self._board(np.empty((0, 3)))
        k = len(p_WB)
        return ClutterInstance(
            category="sphere-aperture-clutter",
            shape=("box",) * k,
            size=edges,
            p_WO=p_WB,
            yaw=np.zeros(k),
            mass=np.ones(k),
            movable=np.zeros(k, dtype=bool),
            p_WA=p_WA,
        )

    def aperture_centres(self) -> NDArray[np.float64]:
        """Returns the centres of all apertures, shape (rows * columns, 3); y varies fastest."""
        y = self.aperture_m * (np.arange(self.columns) - 0.5 * (self.columns - 1))
        z = self.aperture_m * (np.arange(self.rows) - 0.5 * (self.rows - 1))
        offsets = np.array([[0.0, yi, zi] for zi in z for yi in y])
        return np.asarray(self.board_centre + offsets)

    def _board(self, p_WA: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns centres and edges of the board's boxes, each shape (k, 3), metres.

        Args:
            p_WA: Centres of the blocked apertures, shape (num_blocked, 3), metres.
        """
        a, b = self.aperture_m, self.bar_m
        width, height = self.columns * a, self.rows * a
        upright = [[0.0, a * i - 0.5 * width, 0.0] for i in range(self.columns + 1)]
        level = [[0.0, 0.0, a * i - 0.5 * height] for i in range(self.rows + 1)]
        p_WB = np.vstack([np.array(upright + level) + self.board_centre, p_WA])
        edges = [[b, b, height + b]] * len(upright) + [[b, width + b, b]] * len(level)
        return p_WB, np.array(edges + [[b, a, a]] * len(p_WA))
