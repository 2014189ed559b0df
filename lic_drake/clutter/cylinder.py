"""Cylinders (paper IV-A): cylinder-clutter and cylinder-aperture-clutter."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, join, make_objects, place_discs
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError

# Maximum number of objects, more are too slow to simulate, and of openings in a barrier.
_MAX_OBJECTS, _MAX_APERTURES = 2000, 50


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
            ranges=dict.fromkeys(("num_movable", "num_fixed"), (0, _MAX_OBJECTS)),
            vectors={"lower": 2, "upper": 2},
            ascending=[("lower", "upper")],
        )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples an environment with uniform centres and without overlap."""
        n = self.num_movable + self.num_fixed
        centres = place_discs(rng, n, self.lower, self.upper, 2.0 * self.radius_m)
        size, movable = [self.radius_m, self.length_m], np.arange(n) < self.num_movable
        return make_objects("cylinder", size, centres, mass=self.mass_kg, movable=movable)


@dataclass(kw_only=True)
class CylinderApertureClutter(CylinderClutter):
    """cylinder-aperture-clutter: cylinders behind a barrier with openings (Fig. 3c).

    The paper gives neither the barrier's position, nor the number and width of its openings:
    `models/scenarios/cylinder-aperture-clutter.yaml` says how those were chosen.
    """

    # Position of the barrier's centre line along x, its length along y and its thickness, metres
    # (wall width from the authors' simulator).
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
            ranges={"num_apertures": (1, _MAX_APERTURES)},
            ascending=[("aperture_y_min_m", "aperture_y_max_m")],
        )
        low, high = self.aperture_y_min_m, self.aperture_y_max_m
        if max(-low, high) + self.aperture_width_m > 0.5 * self.barrier_length_m:
            raise ScenarioError(
                f"apertures at y {low} to {high} do not fit into a barrier of"
                f" {self.barrier_length_m} m; increase barrier_length_m"
            )
        room = self._aperture_distance * (self.num_apertures - 1)
        if room > high - low:
            raise ScenarioError(
                f"{self.num_apertures} apertures need {room:.3g} m between the outermost centres,"
                f" but aperture_y_min_m {low} to aperture_y_max_m {high} is less; use fewer or"
                " narrower ones"
            )
        front = self.lower[0] - self.radius_m
        if front < self.barrier_x_m + 0.5 * self.barrier_thickness_m:
            raise ScenarioError(
                f"cylinders from x = {front:.3f} m would overlap the barrier at"
                f" {self.barrier_x_m} m; raise lower or reduce barrier_x_m"
            )

    @property
    def _aperture_distance(self) -> float:
        """Least distance of neighbouring apertures' centres, metres."""
        return 2.0 * self.aperture_width_m

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples cylinders as in cylinder-clutter, then openings at least two widths apart."""
        cylinders = super().sample(rng)
        # Uniform among all centres that keep their distance, without rejection: what is left of the
        # range beyond the distances is divided at random.
        distances = self._aperture_distance * np.arange(self.num_apertures)
        high = self.aperture_y_max_m - distances[-1]
        y = distances + np.sort(rng.uniform(self.aperture_y_min_m, high, self.num_apertures))
        x, half = self.barrier_x_m, 0.5 * self.barrier_length_m
        p_WA = np.column_stack([np.full_like(y, x), y, np.zeros_like(y)])
        # The parts of the barrier between the openings.
        begin = np.append(-half, y + 0.5 * self.aperture_width_m)
        end = np.append(y - 0.5 * self.aperture_width_m, half)
        edges = [[self.barrier_thickness_m, width, self.length_m] for width in end - begin]
        p_WB = np.column_stack([np.full_like(begin, x), 0.5 * (begin + end)])
        return join(cylinders, make_objects("box", edges, p_WB), p_WA=p_WA)
