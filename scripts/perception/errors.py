"""How far perception is off, and how often it is wrong, in random scenes (paper V-B)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import PerceptionError
from lic_drake.intervals import wilson_interval
from lic_drake.perception.apertures import STATES, find_apertures
from lic_drake.perception.cameras import take_views
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.goal import find_goal
from lic_drake.perception.image import Views
from lic_drake.perception.noise import disturbed_views
from lic_drake.perception.observer import board_of
from lic_drake.reach.scenario import Scenario
from lic_drake.seeds import make_generator
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class ApertureError:
    """What was found of one aperture.

    Attributes:
        scene: Index of the environment.
        noise: Whether images and poses had errors.
        aperture: Index of the aperture.
        truth: What it is: "open", "partly" or "blocked".
        state: What was found: one of `lic_drake.perception.apertures.STATES`.
        probability_open: Its probability of being open.
        error_m: Distance of the found centre from the true one, metres.
        chi_squared: The squared error by the covariance, 3 on average if that is right.
    """

    scene: int
    noise: bool
    aperture: int
    truth: str
    state: str
    probability_open: float
    error_m: float
    chi_squared: float


@dataclass(frozen=True, kw_only=True)
class GoalError:
    """What was found of a goal; NaN where nothing was.

    Attributes:
        scene: Index of the environment.
        noise: Whether images and poses had errors.
        error_m: Distance of the found goal from the true one, metres.
        chi_squared: As of an aperture.
    """

    scene: int
    noise: bool
    error_m: float
    chi_squared: float


def true_states(board: ApertureBoard, instance: ClutterInstance) -> tuple[str, ...]:
    """Returns what each aperture of a board is: "open", "partly" or "blocked"."""
    assert instance.p_WA is not None and instance.material is not None
    covers = np.array([name == "cardboard" for name in instance.material])
    height, middle = instance.size[covers, 2], instance.p_WO[covers]
    states = []
    for p_WA in board.aperture_centres():
        if np.any(np.all(np.isclose(instance.p_WA, p_WA), axis=1)):
            states.append("open")
        else:
            (at,) = np.flatnonzero(
                np.all(np.abs(middle - p_WA) < 0.5 * board.aperture_m - 1e-6, axis=1)
            )
            states.append("blocked" if np.isclose(height[at], board.aperture_m) else "partly")
    return tuple(states)


def measure_scene(
    scenario: Scenario, cameras: CamerasConfig, scene: int
) -> tuple[list[ApertureError], list[GoalError]]:
    """Looks at an evaluation environment, once exactly and once with the cameras' errors.

    Raises:
        RenderingError: Cameras cannot be simulated on this machine.
    """
    instance = scenario.sample_instance("evaluation", scene)
    p_WG = scenario.sample_goal("evaluation", scene)
    exact = take_views(instance, p_WG, cameras)
    noisy = disturbed_views(exact, cameras, make_generator("evaluation", "camera errors", scene))
    apertures, goals = [], []
    for noise, views in ((False, exact), (True, noisy)):
        apertures += _aperture_errors(scenario, instance, cameras, views, scene, noise)
        goals.append(_goal_error(p_WG, cameras, views, scene, noise))
    return apertures, goals


def _aperture_errors(
    scenario: Scenario,
    instance: ClutterInstance,
    cameras: CamerasConfig,
    views: Views,
    scene: int,
    noise: bool,
) -> list[ApertureError]:
    board, model = board_of(scenario)
    truth = true_states(board, instance)
    try:
        found = find_apertures(views.head, cameras.head.camera, model)
    except PerceptionError:
        return [
            ApertureError(
                scene=scene,
                noise=noise,
                aperture=i,
                truth=state,
                state="unseen",
                probability_open=0.5,
                error_m=np.nan,
                chi_squared=np.nan,
            )
            for i, state in enumerate(truth)
        ]
    off = found.p_WA - board.aperture_centres()
    return [
        ApertureError(
            scene=scene,
            noise=noise,
            aperture=i,
            truth=truth[i],
            state=found.states[i],
            probability_open=float(found.probability_open[i]),
            error_m=float(np.linalg.norm(off[i])),
            chi_squared=float(off[i] @ np.linalg.solve(found.covariance[i], off[i])),
        )
        for i in range(len(off))
    ]


def _goal_error(
    p_WG: Vector, cameras: CamerasConfig, views: Views, scene: int, noise: bool
) -> GoalError:
    try:
        found = find_goal(views.external, cameras.external.camera, cameras.ball_radius_m)
    except PerceptionError:
        return GoalError(scene=scene, noise=noise, error_m=np.nan, chi_squared=np.nan)
    off = found.p_WG - p_WG
    return GoalError(
        scene=scene,
        noise=noise,
        error_m=float(np.linalg.norm(off)),
        chi_squared=float(off @ np.linalg.solve(found.covariance, off)),
    )


def perception_report(apertures: Sequence[ApertureError], goals: Sequence[GoalError]) -> str:
    """Returns the errors as Markdown tables."""
    lines = [
        "| | exact images | with the cameras' errors |",
        "|---|---|---|",
        *(_row(name, figure, apertures, goals) for name, figure in _FIGURES.items()),
    ]
    for noise, title in ((False, "exact images"), (True, "with the cameras' errors")):
        lines += ["", f"Apertures, {title} (rows: what they are; columns: what was found)", ""]
        lines += ["| | " + " | ".join(STATES) + " |", "|---" * (len(STATES) + 1) + "|"]
        for truth in STATES[:3]:
            found = [a.state for a in apertures if a.noise == noise and a.truth == truth]
            lines.append(f"| {truth} | " + " | ".join(str(found.count(s)) for s in STATES) + " |")
    return "\n".join(lines) + "\n"


_Figure = Callable[[Sequence[ApertureError], Sequence[GoalError]], str]


def _row(
    name: str, figure: _Figure, apertures: Sequence[ApertureError], goals: Sequence[GoalError]
) -> str:
    cells = [
        figure([a for a in apertures if a.noise == noise], [g for g in goals if g.noise == noise])
        for noise in (False, True)
    ]
    return f"| {name} | {' | '.join(cells)} |"


def _distances(errors: Sequence[ApertureError | GoalError]) -> str:
    values = 1e3 * np.array([e.error_m for e in errors])
    found = values[np.isfinite(values)]
    if not len(found):
        return f"none of {len(values)} found"
    median, high = np.quantile(found, [0.5, 0.95])
    return f"{median:.1f} mm, {high:.1f} mm ({len(found)} of {len(values)} found)"


def _spread(errors: Sequence[ApertureError | GoalError]) -> str:
    values = np.array([e.chi_squared for e in errors])
    return f"{np.nanmean(values):.2f}" if np.any(np.isfinite(values)) else "none"


def _right(apertures: Sequence[ApertureError]) -> str:
    right = sum((a.truth == "open") == (a.state == "open") for a in apertures)
    low, high = wilson_interval(right, len(apertures))
    return (
        f"{100 * right / len(apertures):.2f} % of {len(apertures)}"
        f" ({100 * low:.2f}..{100 * high:.2f})"
    )


def _brier(apertures: Sequence[ApertureError]) -> str:
    off = [a.probability_open - (a.truth == "open") for a in apertures]
    return f"{np.mean(np.square(off)):.4f}"


_FIGURES: dict[str, _Figure] = {
    "aperture's centre: median error, 95 %": lambda apertures, _: _distances(apertures),
    "goal: median error, 95 %": lambda _, goals: _distances(goals),
    "open or not: right (90 % interval)": lambda apertures, _: _right(apertures),
    "probability of being open: Brier score": lambda apertures, _: _brier(apertures),
    "mean squared error by covariance, apertures (3)": lambda apertures, _: _spread(apertures),
    "mean squared error by covariance, goals (3)": lambda _, goals: _spread(goals),
}
