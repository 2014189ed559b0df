"""Cylinders (paper IV-A): cylinder-clutter and cylinder-aperture-clutter."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, join, make_objects
from lic_drake.clutter.placement import place_discs
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

MAX_OBJECTS = 2000
"""Maximum number of objects; more would not be simulated in useful time."""
MAX_APERTURES = 50
"""Maximum number of openings in a barrier."""


@dataclass(kw_only=True)
class CylinderClutter:
    """cylinder-clutter: upright cylinders, some fixed and some movable (Fig. 3a)."""

    # Numbers of cylinders (paper IV-A).
    num_movable: int = 40
    num_fixed: int = 40
    # Radius in metres, from the paper; length in metres, from the authors' simulator.
    radius_m: float = 0.01
    length_m: float = 0.2
    # Mass of a movable cylinder in kg, from the authors' simulator.
    mass_kg: float = 1.0
    # Rectangle for the cylinders' centres, (x, y) in W, metres: 0.65 x 2.4 m (paper IV-A).
    lower: list[float] = field(default_factory=lambda: [0.37, -1.2])
    upper: list[float] = field(default_factory=lambda: [1.02, 1.2])

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=["radius_m", "length_m", "mass_kg"],
            ranges={"num_movable": (0, MAX_OBJECTS), "num_fixed": (0, MAX_OBJECTS)},
            vectors={"lower": 2, "upper": 2},
            ascending=[("lower", "upper")],
        )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment: uniform centres, no two cylinders overlapping.

        Raises:
            ScenarioError: The cylinders do not fit into the rectangle.
        """
        n = self.num_movable + self.num_fixed
        centres = place_discs(rng, n, self.lower, self.upper, 2.0 * self.radius_m)
        return make_objects(
            "cylinder",
            [self.radius_m, self.length_m],
            centres,
            mass=self.mass_kg,
            movable=np.arange(n) < self.num_movable,
        )


@dataclass(kw_only=True)
class CylinderApertureClutter(CylinderClutter):
    """cylinder-aperture-clutter: a barrier with openings stands before the cylinders (Fig. 3c).

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
        check_numbers(
            self,
            finite=["barrier_x_m", "aperture_y_min_m", "aperture_y_max_m"],
            positive=["barrier_length_m", "barrier_thickness_m", "aperture_width_m"],
            ranges={"num_apertures": (1, MAX_APERTURES)},
            ascending=[("aperture_y_min_m", "aperture_y_max_m")],
        )
        low, high = self.aperture_y_min_m, self.aperture_y_max_m
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
        low = [self.barrier_x_m, self.aperture_y_min_m]
        high = [self.barrier_x_m, self.aperture_y_max_m]
        centres = place_discs(rng, self.num_apertures, low, high, 2.0 * self.aperture_width_m)
        centres = centres[np.argsort(centres[:, 1])]
        p_WA = np.column_stack([centres, np.zeros(len(centres))])
        return join(cylinders, self._barrier(centres[:, 1]), p_WA=p_WA)

    def _barrier(self, y: Vector) -> ClutterInstance:
        """Returns the parts of the barrier between openings centred at y, shape (k,), ascending."""
        half = 0.5 * self.barrier_length_m
        begin = np.append(-half, y + 0.5 * self.aperture_width_m)
        end = np.append(y - 0.5 * self.aperture_width_m, half)
        x, thickness = np.full_like(begin, self.barrier_x_m), self.barrier_thickness_m
        edges = [[thickness, width, self.length_m] for width in end - begin]
        return make_objects("box", edges, np.column_stack([x, 0.5 * (begin + end)]))
