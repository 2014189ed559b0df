"""Starts of an arm in the plane: on a line, or in the apertures of a barrier (paper IV-A, V-A)."""

from dataclasses import asdict, dataclass
from functools import cached_property, lru_cache

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.reach.start import Starts
from lic_drake.reach.task import BaseTrack, StartLine
from lic_drake.robots.arm import Arm
from lic_drake.seeds import make_generator
from lic_drake.starts.feasible import TOLERANCE, Effort, FeasibleStarts, Region
from lic_drake.types import Vector

LATTICE_SHAPE = (33, 25)
"""Numbers of positions and orientations of the lattice: 0.025 m and 7.5 degrees apart."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LineStarts(FeasibleStarts):
    """Hand poses (x, y, phi) on a line that belongs to R, within the arm's joint limits.

    With phi within +-90 degrees the whole last link is behind the line, in the open space outside
    the clutter. A fixed base has the line in W. A base on a track brings the line to the apertures:
    the hand starts in the centre of one, and where it may be relative to the base, says the line.
    """

    robot: Arm
    line: StartLine
    track: BaseTrack | None = None
    p_WA: Vector | None = None

    @property
    def arm(self) -> Arm:
        """The robot."""
        return self.robot

    @property
    def effort(self) -> Effort:  # type: ignore[override]
        """Where the base moves, too, LIC-2 has many local optima."""
        return Effort() if self.track is None else Effort(solves=20, solves_per_region=20)

    @cached_property
    def regions(self) -> tuple[Region, ...]:
        """The line, or one an aperture, where orientation and base are free."""
        line, track = self.line, self.track
        if track is None or self.p_WA is None:
            still = np.zeros(3)
            return (Region(lower=line.lower, upper=line.upper, b0_lower=still, b0_upper=still),)
        return tuple(
            Region(
                lower=np.array([x, y, line.lower[2]]),
                upper=np.array([x, y, line.upper[2]]),
                b0_lower=np.array([x - line.x_m, max(track.y_min_m, y - line.y_max_m), 0.0]),
                b0_upper=np.array([x - line.x_m, min(track.y_max_m, y - line.y_min_m), 0.0]),
            )
            for x, y, _ in self.p_WA
        )

    @cached_property
    def grid(self) -> Starts:
        """The poses of the line's grid, at every aperture from which the track allows them."""
        return self._placed(_possible(self.robot, tuple(asdict(self.line).items()), False))

    def lattice(self, values: Vector) -> Starts:
        """Returns all possible poses of a lattice over the line, at every aperture."""
        return self._lattice

    @cached_property
    def _lattice(self) -> Starts:
        return self._placed(_possible(self.robot, tuple(asdict(self.line).items()), True))

    def solve(self, x0: Vector, b0: Vector, near: Vector | None = None) -> Vector | None:
        """See `FeasibleStarts.solve`."""
        x0_R = x0 - [b0[0], b0[1], 0.0]
        low, high = self.line.lower - TOLERANCE, self.line.upper + TOLERANCE
        inside = any(region.holds(x0, b0) for region in self.regions)
        if not (inside and np.all(x0_R >= low) and np.all(x0_R <= high)):
            return None
        q = self.robot.solve_ik(x0_R, near)
        return q[0] if len(q) else None

    def training(self, stream: str, environment: int) -> Starts:
        """Returns the grid of a fixed base (IV-A), or random starts at each aperture.

        The grid of a mobile base would be far larger than the paper's 15 reaches an environment.
        """
        if self.track is None or self.p_WA is None:
            return self.grid.without_q()
        rng = make_generator(stream, "starts", environment)
        return self.draw(rng, self.track.starts_per_aperture)

    def draw(self, rng: np.random.Generator, per_region: int) -> Starts:
        """Draws uniformly among all, the same number in each region; a RequestError if none is."""
        found = [self._draw_one(rng, region) for region in self.regions for _ in range(per_region)]
        x0, b0 = zip(*found, strict=True)
        return Starts(np.array(x0), np.array(b0))

    def _draw_one(self, rng: np.random.Generator, region: Region) -> tuple[Vector, Vector]:
        high = np.maximum(region.b0_lower, region.b0_upper)[:2]
        for _ in range(10_000):
            x0 = rng.uniform(region.lower, region.upper)
            b0 = np.append(rng.uniform(region.b0_lower[:2], high), 0.0)
            if self.solve(x0, b0) is not None:
                return x0, b0
        raise RequestError(
            f"the arm reaches the aperture at y = {region.lower[1]:.3f} m from nowhere on its"
            " track; widen task.base or the orientations of task.start_line"
        )

    def _placed(self, poses: Starts) -> Starts:
        """Returns poses in R as starts, at each aperture if there are any."""
        if self.track is None or self.p_WA is None:
            return poses
        low, high = self.track.y_min_m - TOLERANCE, self.track.y_max_m + TOLERANCE
        found = poses.take(np.zeros(0, dtype=int))
        for x, y, _ in self.p_WA:
            x0 = np.column_stack([np.tile([x, y], (len(poses), 1)), poses.x0[:, 2]])
            b0 = np.column_stack([[x, y] - poses.x0[:, :2], np.zeros(len(poses))])
            on_track = (b0[:, 1] >= low) & (b0[:, 1] <= high)
            # Rounding must not make one base two.
            found = found.join(Starts(x0, np.round(b0, 12), poses.q).take(on_track))
        return found


def scan(arm: Arm, line: StartLine, num_y: int, num_phi: int) -> Starts:
    """Returns the poses of a lattice over a start line that an arm can take, in R."""
    y = np.linspace(line.lower[1], line.upper[1], num_y)
    phi = np.linspace(line.lower[2], line.upper[2], num_phi)
    return _solved(arm, np.array([[line.x_m, yi, phi_i] for yi in y for phi_i in phi]))


@lru_cache(maxsize=32)
def _possible(arm: Arm, line: tuple[tuple[str, float], ...], dense: bool) -> Starts:
    """Returns the poses of a start line's grid or lattice that an arm can take, in R."""
    start_line = StartLine(**dict(line))
    return scan(arm, start_line, *LATTICE_SHAPE) if dense else _solved(arm, start_line.grid(arm))


def _solved(arm: Arm, poses: Vector) -> Starts:
    """Returns those of n hand poses that an arm can take, from a base at the origin."""
    q = [arm.solve_ik(x0) for x0 in poses]
    kept = [k for k, rows in enumerate(q) if len(rows)]
    angles = np.array([q[k][0] for k in kept]).reshape(-1, len(arm.q_min))
    return Starts(poses[kept].reshape(-1, 3), np.zeros((len(kept), 3)), angles)
