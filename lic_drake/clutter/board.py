"""The board with square apertures that stands before clutter in space (paper IV-B, V-B)."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import ScenarioError
from lic_drake.types import Vector

MAX_APERTURES = 20
"""A board with more rows or columns is refused."""


@dataclass(kw_only=True)
class ApertureBoard:
    """Parameters of the board; a category with a board inherits them.

    Size and number of the apertures are the paper's.
    """

    # The board's centre in W, metres; it is upright, across x.
    board_centre: list[float] = field(default_factory=lambda: [0.53, -0.29, 0.89])
    columns: int = 5
    rows: int = 4
    # Distance of neighbouring apertures' centres, and width and thickness of the bars between
    # them, metres. The bars take their width from the apertures: with centres 0.2 m apart (paper
    # IV-B) there is no other room, and so do the poles of the authors' planar generator.
    aperture_m: float = 0.2
    bar_m: float = 0.01
    # So many apertures are blocked, at random.
    num_blocked: int = 0

    def __post_init__(self) -> None:
        for name in ("aperture_m", "bar_m"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ScenarioError(f"{name} must be a positive number, got {value}")
        if len(self.board_centre) != 3 or not np.all(np.isfinite(self.board_centre)):
            raise ScenarioError(
                f"board_centre must be [x, y, z] in metres, got {self.board_centre}"
            )
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

    @property
    def board_back_m(self) -> float:
        """Where the board ends along Wx, metres."""
        return self.board_centre[0] + 0.5 * self.bar_m

    def aperture_centres(self) -> Vector:
        """Returns the centres of all apertures, shape (rows * columns, 3); y varies fastest."""
        y = self.aperture_m * (np.arange(self.columns) - 0.5 * (self.columns - 1))
        z = self.aperture_m * (np.arange(self.rows) - 0.5 * (self.rows - 1))
        offsets = np.array([[0.0, yi, zi] for zi in z for yi in y])
        return np.asarray(self.board_centre + offsets)

    def bare_board(self) -> ClutterInstance:
        """Returns the board alone with no aperture blocked: all that is known beforehand."""
        p_WB, edges = self.bar_boxes()
        k = len(p_WB)
        return ClutterInstance(
            category="board",
            shape=("box",) * k,
            size=edges,
            p_WO=p_WB,
            yaw=np.zeros(k),
            mass=np.ones(k),
            movable=np.zeros(k, dtype=bool),
            p_WA=self.aperture_centres(),
        )

    def bar_boxes(self) -> tuple[Vector, Vector]:
        """Returns centres and edges of the bars, each shape (k, 3), metres."""
        a, b = self.aperture_m, self.bar_m
        width, height = self.columns * a, self.rows * a
        upright = [[0.0, a * i - 0.5 * width, 0.0] for i in range(self.columns + 1)]
        level = [[0.0, 0.0, a * i - 0.5 * height] for i in range(self.rows + 1)]
        edges = [[b, b, height + b]] * len(upright) + [[b, width + b, b]] * len(level)
        return np.array(upright + level) + self.board_centre, np.array(edges)
