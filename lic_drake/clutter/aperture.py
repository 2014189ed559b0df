"""cylinder-aperture-clutter: cylinders behind a barrier with openings (paper IV-A, Fig. 3c)."""

from dataclasses import dataclass, replace

import numpy as np

from lic_drake.clutter.cylinder import CylinderClutter
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.placement import place_discs
from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

MAX_APERTURES = 50
"""A barrier with more openings is refused."""


@dataclass(kw_only=True)
class CylinderApertureClutter(CylinderClutter):
    """Parameters of the category: those of cylinder-clutter and of the barrier in front of it.

    The paper gives neither the barrier's place, nor the number and width of its openings:
    `models/scenarios/cylinder-aperture-clutter.yaml` says how those were chosen.
    """

    # The barrier's middle line lies at this distance from the base, along y, metres; its length
    # and thickness, metres (wall width from the authors' simulator).
    barrier_x_m: float = 0.335
    barrier_length_m: float = 3.2
    barrier_thickness_m: float = 0.02
    # Number of openings, their width, and the range of their centres along y, metres.
    num_apertures: int = 3
    aperture_width_m: float = 0.1
    aperture_y_min_m: float = -0.6
    aperture_y_max_m: float = 0.6

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.num_apertures <= MAX_APERTURES:
            raise ScenarioError(
                f"num_apertures must be from 1 to {MAX_APERTURES}, got {self.num_apertures}"
            )
        for name in ("barrier_length_m", "barrier_thickness_m", "aperture_width_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ScenarioError(f"{name} must be a positive number, got {value}")
        low, high = self.aperture_y_min_m, self.aperture_y_max_m
        if not (np.all(np.isfinite([low, high, self.barrier_x_m])) and low <= high):
            raise ScenarioError(
                "apertures need finite aperture_y_min_m <= aperture_y_max_m, got"
                f" {low} and {high}, and a finite barrier_x_m, got {self.barrier_x_m}"
            )
        if max(-low, high) + self.aperture_width_m > 0.5 * self.barrier_length_m:
            raise ScenarioError(
                f"apertures at y {low} to {high} do not fit into a barrier of"
                f" {self.barrier_length_m} m; give it a larger barrier_length_m"
            )
        front = self.lower[0] - self.radius_m
        if front < self.barrier_x_m + 0.5 * self.barrier_thickness_m:
            raise ScenarioError(
                f"cylinders from x = {front:.3f} m on would stand in the barrier at"
                f" {self.barrier_x_m} m; raise lower or reduce barrier_x_m"
            )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws cylinders as in cylinder-clutter, and then the openings of the barrier.

        Centres of openings are uniform, none nearer to another than two widths, so that some
        barrier stands between them.

        Raises:
            ScenarioError: Cylinders or openings do not fit.
        """
        cylinders = super().sample(rng)
        low = np.array([self.barrier_x_m, self.aperture_y_min_m])
        high = np.array([self.barrier_x_m, self.aperture_y_max_m])
        centres = place_discs(rng, self.num_apertures, low, high, 2.0 * self.aperture_width_m)
        centres = centres[np.argsort(centres[:, 1])]
        p_WO, size = self._walls(centres[:, 1])
        n = len(p_WO)
        return replace(
            cylinders,
            category="cylinder-aperture-clutter",
            shape=(*cylinders.shape, *("box",) * n),
            size=np.vstack([cylinders.size, size]),
            p_WO=np.vstack([cylinders.p_WO, p_WO]),
            yaw=np.append(cylinders.yaw, np.zeros(n)),
            mass=np.append(cylinders.mass, np.ones(n)),
            movable=np.append(cylinders.movable, np.zeros(n, dtype=bool)),
            p_WA=np.column_stack([centres, np.zeros(len(centres))]),
        )

    def _walls(self, y: Vector) -> tuple[Vector, Vector]:
        """Returns positions and sizes of the barrier's parts, each (k + 1, 3), metres.

        Args:
            y: Centres of the openings, shape (k,), ascending, metres.
        """
        half = 0.5 * self.barrier_length_m
        begin = np.append(-half, y + 0.5 * self.aperture_width_m)
        end = np.append(y - 0.5 * self.aperture_width_m, half)
        x, zeros = np.full(len(begin), self.barrier_x_m), np.zeros(len(begin))
        thickness = np.full(len(begin), self.barrier_thickness_m)
        height = np.full(len(begin), self.length_m)
        return (
            np.column_stack([x, 0.5 * (begin + end), zeros]),
            np.column_stack([thickness, end - begin, height]),
        )
