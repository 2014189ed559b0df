"""passage-clutter: a narrow passage between two fixed walls (paper IV-A, Fig. 3b)."""

from dataclasses import dataclass, field, replace

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, make_objects
from lic_drake.config import check_numbers


@dataclass(kw_only=True)
class PassageClutter:
    """Parameters of the category; the goal of an environment is the centre of its passage.

    Dimensions are the paper's. It states neither distance nor direction of the passages:
    `models/scenarios/passage-clutter.yaml` says how those were chosen.
    """

    # Metres, from the paper (IV-A); the height from the authors' simulator.
    gap_m: float = 0.1
    wall_length_m: float = 0.4
    wall_width_m: float = 0.02
    wall_height_m: float = 0.2
    # Ends of the segment of passage centres, (x, y) in W, metres: 0.4 m long and "horizontal"
    # (paper IV-A), that is along y, as the paper calls +x "vertical" (Fig. 6).
    centre_from: list[float] = field(default_factory=lambda: [0.695, -0.2])
    centre_to: list[float] = field(default_factory=lambda: [0.695, 0.2])
    # Range of the walls' direction, degrees counterclockwise from +x, from -90 to 90.
    min_slope_deg: float = 5.0
    max_slope_deg: float = 35.0

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=["gap_m", "wall_length_m", "wall_width_m", "wall_height_m"],
            ranges={"min_slope_deg": (-90.0, 90.0), "max_slope_deg": (-90.0, 90.0)},
            vectors={"centre_from": 2, "centre_to": 2},
            ascending=[("min_slope_deg", "max_slope_deg")],
        )

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples an environment with uniform centre and slope."""
        begin, end = np.array(self.centre_from), np.array(self.centre_to)
        centre = begin + rng.uniform() * (end - begin)
        slope = np.deg2rad(rng.uniform(self.min_slope_deg, self.max_slope_deg))
        # From the centre to the centre line of the wall on the left.
        to_wall = 0.5 * (self.gap_m + self.wall_width_m) * np.array([-np.sin(slope), np.cos(slope)])
        edges = [self.wall_length_m, self.wall_width_m, self.wall_height_m]
        walls = make_objects("box", edges, [centre + to_wall, centre - to_wall], yaw=slope)
        return replace(walls, p_WG=np.append(centre, 0.0))
