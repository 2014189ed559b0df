"""foliage-aperture-clutter: elastic stems with leaves behind a board (paper V-B)."""

from dataclasses import dataclass, field

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import (
    MAX_TRIES,
    ClutterInstance,
    Stems,
    join,
    make_objects,
    place_discs,
)
from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError
from lic_drake.types import BoolVector, Vector

# Maximum numbers of stems, of branches, and of leaves on each.
_MAX_STEMS, _MAX_LEAVES = 300, 50


@dataclass(kw_only=True)
class FoliageApertureClutter(ApertureBoard):
    """Board and foliage, which the paper shows (Fig. 1) without giving numbers.

    `models/scenarios/foliage-aperture-clutter.yaml` says how these were chosen.
    """

    num_blocked: int = 6
    # Number of further, partly covered apertures, and the range of the covered shares.
    num_partly_covered: int = 2
    covered_share: list[float] = field(default_factory=lambda: [0.3, 0.7])
    # Thickness of the covers, metres; they are panels in the middle of the board.
    cover_m: float = 0.01
    # The box that contains everything, (x, y, z) in W, metres. Stems are rooted in its floor or
    # hang from its ceiling, and keep this margin to its sides for their leaves.
    lower: list[float] = field(default_factory=lambda: [0.56, -0.79, 0.43])
    upper: list[float] = field(default_factory=lambda: [0.81, 0.21, 1.35])
    margin_m: float = 0.05
    # Height of the trough that holds the roots, metres.
    trough_m: float = 0.15
    # Elastic stems and fixed branches; the share of both that hangs; distance between roots.
    num_stems: int = 40
    num_branches: int = 6
    hanging_share: float = 0.4
    root_distance_m: float = 0.04
    # Ranges of lengths, metres, and largest slant, degrees.
    stem_length_m: list[float] = field(default_factory=lambda: [0.4, 0.75])
    branch_length_m: list[float] = field(default_factory=lambda: [0.25, 0.45])
    max_slant_deg: float = 12.0
    stem_radius_m: float = 0.004
    branch_radius_m: float = 0.006
    # Flexural rigidity EI of a stem, N m^2, mass per length, kg/m, and damping ratio.
    rigidity_N_m2: float = 0.16
    stem_kg_per_m: float = 0.07
    damping_ratio: float = 0.3
    # Leaves on each stem or branch; ranges of their length and width, metres; thickness and mass.
    leaves_per_stem: int = 9
    leaf_length_m: list[float] = field(default_factory=lambda: [0.06, 0.1])
    leaf_width_m: list[float] = field(default_factory=lambda: [0.03, 0.05])
    leaf_thickness_m: float = 0.002
    leaf_kg: float = 0.002

    def __post_init__(self) -> None:
        super().__post_init__()
        lengths = ("stem_length_m", "branch_length_m", "leaf_length_m", "leaf_width_m")
        check_numbers(
            self,
            positive=(
                *("cover_m", "margin_m", "trough_m", "root_distance_m", "stem_radius_m"),
                *("branch_radius_m", "rigidity_N_m2", "stem_kg_per_m", "damping_ratio"),
                *("leaf_thickness_m", "leaf_kg", *lengths),
            ),
            ranges={
                "num_stems": (0, _MAX_STEMS),
                "num_branches": (0, _MAX_STEMS),
                "leaves_per_stem": (0, _MAX_LEAVES),
                "num_partly_covered": (0, self.rows * self.columns - self.num_blocked - 1),
                "covered_share": (0.0, 1.0),
                "hanging_share": (0.0, 1.0),
                "max_slant_deg": (0.0, 45.0),
            },
            intervals=(*lengths, "covered_share"),
            vectors={"lower": 3, "upper": 3},
            ascending=[("lower", "upper")],
        )
        if self.lower[0] < self.board_back_m:
            raise ScenarioError(
                f"foliage from x = {self.lower[0]:.3f} m would overlap the board, whose back is at"
                f" {self.board_back_m:.3f} m; raise lower or move board_centre"
            )
        width, depth, height = np.subtract(self.upper, self.lower)
        if min(width, depth) <= 2.0 * self.margin_m:
            raise ScenarioError(f"margin_m {self.margin_m} must be below half of the box's width")
        longest = max(self.stem_length_m[1], self.branch_length_m[1])
        if longest > height:
            raise ScenarioError(f"stems of {longest} m are longer than the box, {height:.3f} m")

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Samples the foliage, and then the covers, on which the foliage does not depend."""
        stems = self._grow(rng)
        p_WA = self.aperture_centres()
        order = rng.permutation(len(p_WA))
        shares = rng.uniform(*self.covered_share, size=len(p_WA))
        hangs = rng.random(len(p_WA)) < 0.5
        shares[order[: self.num_blocked]] = 1.0
        covered = np.sort(order[: self.num_blocked + self.num_partly_covered])
        # The trough below and the beam above.
        low, high, up = np.array(self.lower), np.array(self.upper), np.eye(3)[2]
        middle, edges = 0.5 * (low + high), high - low
        trough, beam = edges.copy(), edges.copy()
        trough[2], beam[2] = self.trough_m, self.bar_m
        return join(
            self.bare_board("wood"),
            make_objects("box", trough, middle - 0.5 * (edges + trough) * up, material="clay"),
            make_objects("box", beam, middle + 0.5 * (edges + beam) * up, material="wood"),
            self._covers(p_WA[covered], shares[covered], hangs[: len(covered)]),
            p_WA=np.delete(p_WA, covered, axis=0),
            stems=stems,
        )

    def _covers(self, p_WA: Vector, shares: Vector, hangs: BoolVector) -> ClutterInstance:
        """Returns covers of shares of apertures; partial ones stand below or hang above."""
        # Covers extend to the middle of a bar.
        clear = self.aperture_m - self.bar_m
        height = np.where(shares < 1.0, shares * clear + 0.5 * self.bar_m, self.aperture_m)
        offset = np.where(hangs, 1.0, -1.0) * (0.5 * (self.aperture_m - height))
        p_WC = p_WA + np.outer(offset, [0.0, 0.0, 1.0])
        edges = np.column_stack(np.broadcast_arrays(self.cover_m, self.aperture_m, height))
        return make_objects("box", edges, p_WC, material="cardboard")

    def _grow(self, rng: np.random.Generator) -> Stems:
        m = self.num_stems + self.num_branches
        fixed = np.arange(m) >= self.num_stems
        low, high = np.array(self.lower) + self.margin_m, np.array(self.upper) - self.margin_m
        roots = place_discs(rng, m, low[:2], high[:2], self.root_distance_m)
        hangs = rng.random(m) < self.hanging_share
        of_branch = rng.uniform(*self.branch_length_m, size=m)
        length = np.where(fixed, of_branch, rng.uniform(*self.stem_length_m, size=m))
        p_WH = np.column_stack([roots, np.where(hangs, self.upper[2], self.lower[2])])
        slants = [self._slant(rng, *row) for row in zip(p_WH, length, hangs, strict=True)]
        R_WS = np.array(slants).reshape(-1, 3, 3)
        owner = np.repeat(np.arange(m), self.leaves_per_stem)
        leaves = [self._leaf(rng, p_WH[i], R_WS[i], length[i]) for i in owner]
        # The tip stiffness of a cantilever of this rigidity: L^2 / k = L^3 / (3 EI).
        stiffness = 3.0 * self.rigidity_N_m2 / length
        mass = self.stem_kg_per_m * length + self.leaf_kg * self.leaves_per_stem
        damping = 2.0 * self.damping_ratio * np.sqrt(stiffness * (mass * length**2 / 3.0))
        return Stems(
            p_WH=p_WH,
            R_WS=R_WS,
            length=length,
            radius=np.where(fixed, self.branch_radius_m, self.stem_radius_m),
            mass=mass,
            stiffness=np.where(fixed, np.inf, stiffness),
            damping=np.where(fixed, 0.0, damping),
            leaf_stem=owner,
            p_SL=np.array([leaf[0] for leaf in leaves]).reshape(-1, 3),
            R_SL=np.array([leaf[1] for leaf in leaves]).reshape(-1, 3, 3),
            leaf_size=np.array([leaf[2] for leaf in leaves]).reshape(-1, 3),
        )

    def _slant(self, rng: np.random.Generator, p_WH: Vector, length: float, hangs: bool) -> Vector:
        """Samples R_WS of a stem whose tip lies in the box."""
        for _ in range(MAX_TRIES):
            slant = np.deg2rad(self.max_slant_deg) * rng.random()
            azimuth = rng.uniform(0, 2 * np.pi)
            R_WS = _rotation(azimuth, np.pi - slant if hangs else slant)
            if self._holds(p_WH + length * R_WS[:, 2], self.margin_m):
                return R_WS
        raise ScenarioError(
            f"a stem of {length:.3f} m at {p_WH.round(3)} does not fit into the box {self.lower} to"
            f" {self.upper}; enlarge it or increase max_slant_deg"
        )

    def _leaf(
        self, rng: np.random.Generator, p_WH: Vector, R_WS: Vector, length: float
    ) -> tuple[Vector, Vector, Vector]:
        """Samples p_SL, R_SL and size of a leaf in the box."""
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
        for _ in range(MAX_TRIES):
            edges = [rng.uniform(*ends, size=1) for ends in (self.leaf_length_m, self.leaf_width_m)]
            size = np.append(edges, self.leaf_thickness_m)
            along = length * rng.uniform(0.1, 1.0)
            # Outwards and up the stem, 10 to 60 degrees from perpendicular, and twisted.
            R_SL = _rotation(rng.uniform(0.0, 2.0 * np.pi), -np.deg2rad(rng.uniform(10.0, 60.0)))
            twist = np.deg2rad(rng.uniform(-45.0, 45.0))
            c, s = np.cos(twist), np.sin(twist)
            R_SL = R_SL @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
            p_SL = np.array([0.0, 0.0, along]) + 0.5 * size[0] * R_SL[:, 0]
            if self._holds(p_WH + (p_SL + (0.5 * size * signs) @ R_SL.T) @ R_WS.T):
                return p_SL, R_SL, size
        raise ScenarioError(
            f"no leaf on the stem at {p_WH.round(3)} fits into the box {self.lower} to"
            f" {self.upper}; enlarge it or reduce leaf_length_m"
        )

    def _holds(self, p_WQ: Vector, margin: float = 0.0) -> bool:
        """Returns whether all points lie in the box, at least `margin` from its sides."""
        inset = np.array([margin, margin, 0.0])
        return bool(np.all((p_WQ >= self.lower + inset) & (p_WQ <= self.upper - inset)))


def _rotation(azimuth: float, tilt: float) -> Vector:
    """Returns Rz(azimuth) Ry(tilt): z is tilted towards the azimuth."""
    ca, sa, ct, st = np.cos(azimuth), np.sin(azimuth), np.cos(tilt), np.sin(tilt)
    return np.array([[ca * ct, -sa, ca * st], [sa * ct, ca, sa * st], [-st, 0.0, ct]])
