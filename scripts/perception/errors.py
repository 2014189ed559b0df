"""Accuracy of perception in random scenes (paper V-B)."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from lic_drake.clutter.board import ApertureBoard
from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import PerceptionError
from lic_drake.intervals import wilson_interval
from lic_drake.perception.apertures import STATES, find_apertures
from lic_drake.perception.cameras import Views, take_views
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.goal import find_goal
from lic_drake.perception.image import disturbed_image
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
    assert instance.p_WA is not None
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


def disturbed_views(views: Views, cameras: CamerasConfig, rng: np.random.Generator) -> Views:
    """Returns both images with the cameras' errors."""
    return Views(
        disturbed_image(views.head, cameras.head.camera, rng),
        disturbed_image(views.external, cameras.external.camera, rng),
    )


def measure_scene(
    scenario: Scenario, cameras: CamerasConfig, scene: int
) -> tuple[list[ApertureError], list[GoalError]]:
    """Observes an evaluation environment, with exact images and with the cameras' errors.

    Raises:
        RenderingError: Cameras cannot be simulated on this machine.
    """
    instance = scenario.sample_instance("evaluation", scene)
    p_WG = scenario.sample_goal("evaluation", scene)
    exact = take_views(instance, p_WG, cameras)
    rng = make_generator("evaluation", "camera errors", scene)
    noisy = disturbed_views(exact, cameras, rng)
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
    board = board_of(scenario)
    truth = true_states(board, instance)
    states, probability = ("unseen",) * len(truth), np.full(len(truth), 0.5)
    error = chi_squared = np.full(len(truth), np.nan)
    with suppress(PerceptionError):
        found = find_apertures(views.head, cameras.head.camera, board)
        states, probability = found.states, found.probability_open
        off = found.p_WA - board.aperture_centres()
        error = np.linalg.norm(off, axis=1)
        chi_squared = np.array(
            [e @ np.linalg.solve(C, e) for e, C in zip(off, found.covariance, strict=True)]
        )
    return [
        ApertureError(
            scene=scene,
            noise=noise,
            aperture=i,
            truth=truth[i],
            state=states[i],
            probability_open=float(probability[i]),
            error_m=float(error[i]),
            chi_squared=float(chi_squared[i]),
        )
        for i in range(len(truth))
    ]


def _goal_error(
    p_WG: Vector, cameras: CamerasConfig, views: Views, scene: int, noise: bool
) -> GoalError:
    error = chi_squared = np.nan
    with suppress(PerceptionError):
        found = find_goal(views.external, cameras.external.camera, cameras.ball_radius_m)
        off = found.p_WG - p_WG
        error = float(np.linalg.norm(off))
        chi_squared = float(off @ np.linalg.solve(found.covariance, off))
    return GoalError(scene=scene, noise=noise, error_m=error, chi_squared=chi_squared)


def perception_report(apertures: Sequence[ApertureError], goals: Sequence[GoalError]) -> str:
    """Returns the errors as Markdown tables."""
    exact, noisy = (
        _figures([a for a in apertures if a.noise == noise], [g for g in goals if g.noise == noise])
        for noise in (False, True)
    )
    lines = [
        "| | exact images | with the cameras' errors |",
        "|---|---|---|",
        *(f"| {name} | {exact[name]} | {noisy[name]} |" for name in exact),
    ]
    for noise, title in ((False, "exact images"), (True, "with the cameras' errors")):
        lines += ["", f"Apertures, {title} (rows: what they are; columns: what was found)", ""]
        lines += ["| | " + " | ".join(STATES) + " |", "|---" * (len(STATES) + 1) + "|"]
        for truth in STATES[:3]:
            found = [a.state for a in apertures if a.noise == noise and a.truth == truth]
            lines.append(f"| {truth} | " + " | ".join(str(found.count(s)) for s in STATES) + " |")
    return "\n".join(lines) + "\n"


def _figures(apertures: Sequence[ApertureError], goals: Sequence[GoalError]) -> dict[str, str]:
    """Returns the figures of one column of the report by name."""
    right = sum((a.truth == "open") == (a.state == "open") for a in apertures)
    low, high = wilson_interval(right, len(apertures))
    off = [a.probability_open - (a.truth == "open") for a in apertures]
    return {
        "aperture's centre: median error, 95 %": _distances(apertures),
        "goal: median error, 95 %": _distances(goals),
        "open or not: right (90 % interval)": f"{100 * right / len(apertures):.2f} % of"
        f" {len(apertures)} ({100 * low:.2f}..{100 * high:.2f})",
        "probability of being open: Brier score": f"{np.mean(np.square(off)):.4f}",
        "mean squared error by covariance, apertures (3)": _spread(apertures),
        "mean squared error by covariance, goals (3)": _spread(goals),
    }


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
