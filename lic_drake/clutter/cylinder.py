"""cylinder-clutter: upright cylinders, some fixed and some movable (paper IV-A)."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.placement import place_discs
from lic_drake.errors import ScenarioError

MAX_OBJECTS = 2000
"""More objects than this are refused: the simulation would not finish in useful time."""


@dataclass(kw_only=True)
class CylinderClutter:
    """Parameters of the category; the defaults are the paper's."""

    # Numbers of cylinders, paper IV-A.
    num_movable: int = 40
    num_fixed: int = 40
    # Radius in metres, paper IV-A; length in metres, from the authors' simulator.
    radius_m: float = 0.01
    length_m: float = 0.2
    # Mass of a movable cylinder in kg, from the authors' simulator.
    mass_kg: float = 1.0
    # Rectangle for the cylinders' centres, (x, y) in W, metres: 0.65 x 2.4 m (paper IV-A).
    lower: list[float] = field(default_factory=lambda: [0.37, -1.2])
    upper: list[float] = field(default_factory=lambda: [1.02, 1.2])

    def __post_init__(self) -> None:
        for name in ("num_movable", "num_fixed"):
            value = getattr(self, name)
            if not 0 <= value <= MAX_OBJECTS:
                raise ScenarioError(f"{name} must be from 0 to {MAX_OBJECTS}, got {value}")
        for name in ("radius_m", "length_m", "mass_kg"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ScenarioError(f"{name} must be a positive number, got {value}")
        if not len(self.lower) == len(self.upper) == 2 or not np.all(
            np.isfinite([*self.lower, *self.upper])
        ):
            raise ScenarioError(
                f"lower and upper must be [x, y] in metres, got {self.lower}, {self.upper}"
            )
        if self.lower[0] >= self.upper[0] or self.lower[1] >= self.upper[1]:
            raise ScenarioError(f"lower {self.lower} must be below upper {self.upper} in x and y")

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment: uniform centres, no two cylinders overlapping.

        Raises:
            ScenarioError: The cylinders do not fit into the rectangle.
        """
        n = self.num_movable + self.num_fixed
        centres = place_discs(
            rng, n, np.array(self.lower), np.array(self.upper), 2.0 * self.radius_m
        )
        return ClutterInstance(
            category="cylinder-clutter",
            shape=("cylinder",) * n,
            size=np.tile([self.radius_m, self.length_m, 0.0], (n, 1)),
            p_WO=np.column_stack([centres, np.zeros(n)]),
            yaw=np.zeros(n),
            mass=np.full(n, self.mass_kg),
            movable=np.arange(n) < self.num_movable,
        )
