"""Where a reach may start, where its goals lie (paper IV-A), and when it ends."""

import dataclasses
import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from lic_drake.config import check_numbers
from lic_drake.errors import ScenarioError
from lic_drake.robots.arm import Arm
from lic_drake.types import Vector

MAX_GRID_STEPS = 1000
"""A finer grid than this in one direction is refused."""

MAX_TIMEOUT_S = 3600.0
"""Maximum simulated time of a reach; a longer one would take minutes to simulate."""


@dataclass(kw_only=True)
class StartLine:
    """Hand poses x0 = (x, y, phi) on a segment between robot and clutter, in R, with their grid."""

    # Distance of the segment from the base, metres. With the arm's joint limits only
    # 0.325..0.342 m leaves the paper's 21 (and 14) initial conditions.
    x_m: float = 0.335
    # Ends of the segment and grid distance, metres.
    y_min_m: float = -0.4
    y_max_m: float = 0.4
    y_step_m: float = 0.1
    # Range of orientations and grid distance, degrees.
    phi_min_deg: float = -90.0
    phi_max_deg: float = 90.0
    phi_step_deg: float = 30.0

    def __post_init__(self) -> None:
        check_numbers(self, finite=["x_m"])
        _check_range("start line y_m", self.y_min_m, self.y_max_m, self.y_step_m)
        _check_range("start line phi_deg", self.phi_min_deg, self.phi_max_deg, self.phi_step_deg)

    @property
    def lower(self) -> Vector:
        """Lower bounds of x0, shape (3,)."""
        return np.array([self.x_m, self.y_min_m, np.deg2rad(self.phi_min_deg)])

    @property
    def upper(self) -> Vector:
        """Upper bounds of x0, shape (3,)."""
        return np.array([self.x_m, self.y_max_m, np.deg2rad(self.phi_max_deg)])

    def grid(self, arm: Arm) -> Vector:
        """Returns the grid poses that the arm can take, shape (n, 3)."""
        y = _steps(self.y_min_m, self.y_max_m, self.y_step_m)
        phi = np.deg2rad(_steps(self.phi_min_deg, self.phi_max_deg, self.phi_step_deg))
        poses = np.array([[self.x_m, yi, phi_i] for yi in y for phi_i in phi])
        return poses[[len(arm.solve_ik(x0)) > 0 for x0 in poses]]


@dataclass(kw_only=True)
class GoalArea:
    """Rectangle or, in space, box of goals p_WG with its training grid."""

    # Corners (x, y) or (x, y, z) in W and grid distance, metres.
    lower: list[float] = field(default_factory=lambda: [0.45, -0.4])
    upper: list[float] = field(default_factory=lambda: [0.85, 0.4])
    step_m: float = 0.1
    # A collection tries this many random goals in each environment; 0: the grid.
    random_goals: int = 0

    def __post_init__(self) -> None:
        if len(self.lower) != len(self.upper) or len(self.lower) not in (2, 3):
            raise ScenarioError(
                "goal area corners must be [x, y], or [x, y, z] for a robot in space, got"
                f" {self.lower}, {self.upper}"
            )
        for name, low, high in zip("xyz", self.lower, self.upper, strict=False):
            _check_range(f"goal area {name}", low, high, self.step_m)
        check_numbers(self, non_negative=["random_goals"])

    def grid(self) -> Vector:
        """Returns the grid goals, shape (n, 3), metres; x varies slowest."""
        corners = zip(self.lower, self.upper, strict=True)
        steps = [_steps(low, high, self.step_m) for low, high in corners]
        return np.array(list(itertools.product(*steps, *[[0.0]] * (3 - len(steps)))))

    def sample(self, rng: np.random.Generator) -> Vector:
        """Draws a goal p_WG uniformly, shape (3,), metres."""
        p_WG = rng.uniform(self.lower, self.upper)
        return np.append(p_WG, np.zeros(3 - len(p_WG)))


@dataclass(kw_only=True)
class BaseTrack:
    """Where a mobile base may stand, on a segment along Wy (paper Fig. 3c), to reach by apertures.

    The hand starts in the centre of one; the start line says which poses are possible in R.
    """

    # Ends of the segment, metres.
    y_min_m: float = -0.6
    y_max_m: float = 0.6
    # A collection tries this many random starts at each aperture of an environment.
    starts_per_aperture: int = 5

    def __post_init__(self) -> None:
        _check_range("base track y_m", self.y_min_m, self.y_max_m, 0.1)
        check_numbers(self, positive=["starts_per_aperture"])


@dataclass(kw_only=True)
class Stand:
    """Where the base along Wy and the torso of a robot in space may be (paper IV-B)."""

    # Ends of the segment, metres.
    y_min_m: float = 0.0
    y_max_m: float = 0.0
    # Lowest and highest torso, metres.
    torso_min_m: float = 0.15
    torso_max_m: float = 0.15
    # A collection's environments have each of these with each of those, in turn.
    training_y_m: list[float] = field(default_factory=lambda: [0.0])
    training_torso_m: list[float] = field(default_factory=lambda: [0.15])

    def __post_init__(self) -> None:
        _check_range("stand y_m", self.y_min_m, self.y_max_m, 0.1)
        _check_range("stand torso_m", self.torso_min_m, self.torso_max_m, 0.1)
        ends = {
            "training_y_m": (self.y_min_m, self.y_max_m),
            "training_torso_m": (self.torso_min_m, self.torso_max_m),
        }
        check_numbers(self, ranges=ends)
        if not self.training_y_m or not self.training_torso_m:
            raise ScenarioError(f"stand: {' and '.join(ends)} need one number at least, got []")

    def for_training(self, environment: int) -> tuple[float, float]:
        """Returns the base's y and the torso's height in an environment of a library, metres."""
        pairs = [(y, torso) for torso in self.training_torso_m for y in self.training_y_m]
        return pairs[environment % len(pairs)]


@dataclass(kw_only=True)
class Task:
    """The start line and the goals of a scenario."""

    start_line: StartLine = field(default_factory=StartLine)
    # None: the base is fixed at the origin.
    base: BaseTrack | None = None
    # Height of the robot's torso lift, metres; 0 for a robot without one.
    torso_m: float = 0.0
    # None: base and torso stay where they are.
    stand: Stand | None = None
    # None: the goal is the one that each environment offers (passage-clutter).
    goal_area: GoalArea | None = field(default_factory=GoalArea)

    @property
    def b0(self) -> Vector:
        """Base and torso where they have no reason to move, (x, y, torso), shape (3,), metres."""
        return np.array([0.0, 0.0, self.torso_m])


@dataclass(kw_only=True)
class StopConfig:
    """Limits of a reach; the paper states none of them."""

    # A reach succeeds when the tip is this near the goal, metres (authors' batch scripts).
    success_distance_m: float = 0.015
    # A reach is stuck when the tip moved less than `stuck_distance_m` in `stuck_time_s`.
    stuck_distance_m: float = 0.005
    stuck_time_s: float = 3.0
    # Where objects give way slowly: a reach is also stuck when its smallest distance to the goal
    # fell by less than `progress_m` in `progress_time_s`; 0: this does not count.
    progress_m: float = 0.0
    progress_time_s: float = 3.0
    # Simulated seconds after which a reach fails.
    timeout_s: float = 30.0
    # A reach fails when a taxel reads more than `force_limit_N` for `force_time_s` on end; a single
    # sample of an impact does not count. The authors' controller shuts down at 15 N.
    force_limit_N: float = 15.0
    force_time_s: float = 0.1

    def __post_init__(self) -> None:
        # An infinite limit switches a rule off.
        ranges = {item.name: (0.0, math.inf) for item in dataclasses.fields(self)}
        ranges["timeout_s"] = (0.0, MAX_TIMEOUT_S)
        check_numbers(self, positive=["success_distance_m"], ranges=ranges)


def _check_range(name: str, low: float, high: float, step: float) -> None:
    finite = np.all(np.isfinite([low, high, step]))
    if not finite or not 0.0 <= high - low <= MAX_GRID_STEPS * step or step <= 0.0:
        raise ScenarioError(
            f"{name}: needs finite numbers with min <= max and at most {MAX_GRID_STEPS} positive"
            f" steps, got {low}..{high} step {step}"
        )


def _steps(low: float, high: float, step: float) -> Vector:
    """Returns low, low + step, .. high, rounded so that grid values print as written."""
    count = int(np.floor((high - low) / step + 1e-9)) + 1
    return np.round(low + step * np.arange(count), 12)
