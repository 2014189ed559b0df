"""The board with square apertures, before spheres and foliage (paper IV-B, V-B)."""

from dataclasses import dataclass, field, replace

import numpy as np

from lic_drake.clutter.instance import ClutterInstance, join, make_objects
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError
from lic_drake.types import IntVector, Vector

_MAX_APERTURES = 20
"""Maximum number of rows or columns; more are too slow to simulate."""


@dataclass(kw_only=True)
class ApertureBoard:
    """Parameters of an upright board across x; size and number of apertures are the paper's."""

    # The board's centre in W, metres.
    board_centre: list[float] = field(default_factory=lambda: [0.53, -0.29, 0.89])
    columns: int = 5
    rows: int = 4
    # Distance of neighbouring apertures' centres (paper IV-B), and width and thickness of the bars
    # between them, metres, which narrow the apertures: there is no other room.
    aperture_m: float = 0.2
    bar_m: float = 0.01
    # Number of randomly chosen apertures that are blocked.
    num_blocked: int = 0

    def __post_init__(self) -> None:
        check_numbers(
            self,
            positive=["aperture_m", "bar_m"],
            ranges={
                **dict.fromkeys(("columns", "rows"), (1, _MAX_APERTURES)),
                "num_blocked": (0, self.rows * self.columns - 1),
            },
            vectors={"board_centre": 3},
        )
        if self.bar_m >= self.aperture_m:
            raise ScenarioError(
                f"bar_m must be below aperture_m {self.aperture_m}, got {self.bar_m}"
            )

    @property
    def board_back_m(self) -> float:
        """Position of the board's back along Wx, metres."""
        return self.board_centre[0] + 0.5 * self.bar_m

    def aperture_centres(self) -> Vector:
        """Returns the centres of all apertures, shape (rows * columns, 3), y varying fastest."""
        y = self.aperture_m * (np.arange(self.columns) - 0.5 * (self.columns - 1))
        z = self.aperture_m * (np.arange(self.rows) - 0.5 * (self.rows - 1))
        offsets = np.array([[0.0, yi, zi] for zi in z for yi in y])
        return self.board_centre + offsets

    def bare_board(self, material: str = "") -> ClutterInstance:
        """Returns the bars alone, with all apertures open, as known in advance."""
        a, b = self.aperture_m, self.bar_m
        width, height = self.columns * a, self.rows * a
        upright = [[0.0, a * i - 0.5 * width, 0.0] for i in range(self.columns + 1)]
        level = [[0.0, 0.0, a * i - 0.5 * height] for i in range(self.rows + 1)]
        edges = [[b, b, height + b]] * len(upright) + [[b, width + b, b]] * len(level)
        p_WB = np.array(upright + level) + self.board_centre
        bars = make_objects("box", edges, p_WB, material=material)
        return replace(bars, p_WA=self.aperture_centres())

    def blocked_board(self, blocked: IntVector) -> ClutterInstance:
        """Returns the board with the apertures at these indices covered."""
        p_WA = self.aperture_centres()
        edges = [self.bar_m, self.aperture_m, self.aperture_m]
        covers = make_objects("box", edges, p_WA[blocked])
        return join(self.bare_board(), covers, p_WA=np.delete(p_WA, blocked, axis=0))
