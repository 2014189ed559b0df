"""A category of your own: boxes on a shelf with a back and two sides, seen from above."""

from dataclasses import dataclass

import numpy as np

from lic_drake import register_category
from lic_drake.clutter.instance import ClutterInstance, join, make_objects, place_discs
from lic_drake.config import check_numbers


@dataclass(kw_only=True)
class ShelfClutter:
    """Parameters of the category; scenario files may change each."""

    num_boxes: int = 12
    # Edges of a box along x and y are drawn between these, metres; mass in kg.
    min_edge_m: float = 0.03
    max_edge_m: float = 0.08
    mass_kg: float = 0.5
    # Front and back of the shelf along x, its width along y, height and thickness of its walls.
    front_x_m: float = 0.40
    back_x_m: float = 0.85
    width_m: float = 0.9
    height_m: float = 0.2
    wall_m: float = 0.02

    def __post_init__(self) -> None:
        check_numbers(self, positive=["min_edge_m", "mass_kg"], ranges={"num_boxes": (1, 40)})
        check_numbers(self, ascending=[("min_edge_m", "max_edge_m")])

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment: boxes turned at random, none overlapping another or a wall."""
        n, half, radius = self.num_boxes, 0.5 * self.width_m, self.max_edge_m / np.sqrt(2.0)
        lower = np.array([self.front_x_m, -half]) + radius + 0.5 * self.wall_m
        upper = np.array([self.back_x_m, half]) - radius - 0.5 * self.wall_m
        centres = place_discs(rng, n, lower, upper, 2.0 * radius)
        edges = rng.uniform(self.min_edge_m, self.max_edge_m, (n, 2))
        size, yaw = np.insert(edges, 2, self.height_m, axis=1), rng.uniform(-np.pi, np.pi, n)
        boxes = make_objects("box", size, centres, yaw=yaw, mass=self.mass_kg, movable=True)
        middle, depth = 0.5 * (self.front_x_m + self.back_x_m), self.back_x_m - self.front_x_m
        across, along = [self.wall_m, self.width_m], [depth, self.wall_m]
        back = make_objects("box", [*across, self.height_m], [self.back_x_m, 0.0])
        sides = make_objects("box", [*along, self.height_m], [[middle, -half], [middle, half]])
        return join(boxes, back, sides)


# LIC-1 knows goal and start in the plane; LIC-2 sees where the first reach started, too.
register_category("shelf-clutter", ShelfClutter)
