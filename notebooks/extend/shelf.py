"""A category of your own: boxes on a shelf with a back and two sides, seen from above."""

from dataclasses import dataclass

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.clutter.placement import place_discs
from lic_drake.clutter.registry import register_category
from lic_drake.errors import ScenarioError
from lic_drake.estimate.categories import register_features


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
        if not 0 < self.num_boxes <= 40:
            raise ScenarioError(f"num_boxes must be from 1 to 40, got {self.num_boxes}")
        if not 0.0 < self.min_edge_m <= self.max_edge_m:
            raise ScenarioError("edges need 0 < min_edge_m <= max_edge_m")

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment: boxes turned at random, none overlapping another or a wall."""
        n, half, radius = self.num_boxes, 0.5 * self.width_m, self.max_edge_m / np.sqrt(2.0)
        lower = np.array([self.front_x_m, -half]) + radius + 0.5 * self.wall_m
        upper = np.array([self.back_x_m, half]) - radius - 0.5 * self.wall_m
        centres = place_discs(rng, n, lower, upper, 2.0 * radius)
        edges = rng.uniform(self.min_edge_m, self.max_edge_m, (n, 2))
        middle, depth = 0.5 * (self.front_x_m + self.back_x_m), self.back_x_m - self.front_x_m
        walls = np.array([[self.back_x_m, 0.0], [middle, -half], [middle, half]])
        wall_edges = np.array([[self.wall_m, self.width_m], *[[depth, self.wall_m]] * 2])
        return ClutterInstance(
            category="shelf-clutter",
            shape=("box",) * (n + 3),
            size=np.column_stack([np.vstack([edges, wall_edges]), np.full(n + 3, self.height_m)]),
            p_WO=np.column_stack([np.vstack([centres, walls]), np.zeros(n + 3)]),
            yaw=np.append(rng.uniform(-np.pi, np.pi, n), np.zeros(3)),
            mass=np.full(n + 3, self.mass_kg),
            movable=np.arange(n + 3) < n,
        )


register_category("shelf-clutter", ShelfClutter)
register_features("shelf-clutter")  # Goal and start; LIC-2 sees where the first reach started.
