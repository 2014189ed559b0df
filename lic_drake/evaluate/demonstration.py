"""The demonstration: select, reach, record, and show what was estimated."""

import itertools
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lic_drake.errors import LicError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import make_estimator
from lic_drake.evaluate.plots import draw_density, draw_top_view, save_figure
from lic_drake.evaluate.trial import Attempt, planar_arm_of
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.recording import ReachRecording
from lic_drake.reach.request import is_within_reach, make_request
from lic_drake.reach.rollout import make_record
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector, needs_library
from lic_drake.select.situation import Situation, StartSet

Vector = NDArray[np.float64]

DENSITY_SHAPE = (81, 91)
"""Lattice of the density picture: y every 1 cm, phi every 2 degrees."""


@dataclass(frozen=True, kw_only=True)
class Demonstration:
    """What was done and where it can be seen.

    Attributes:
        p_WG: Goal, shape (3,), metres.
        attempts: The attempts in their order.
        files: What was written, by kind: recording, density, path, data.
    """

    p_WG: Vector
    attempts: list[Attempt]
    files: dict[str, Path]


def demonstrate(
    scenario: Scenario,
    library: ExperienceLibrary,
    method: str,
    seed: int,
    out: Path,
    attempts: int = 2,
    say: Callable[[str], None] = print,
) -> Demonstration:
    """Selects a start in an unseen environment, reaches, and tries again if that fails.

    Args:
        scenario: The library's scenario.
        library: Experience to learn from; its environments come from another seed stream.
        method: Strategy, see `lic_drake.select.registry.method_names`.
        seed: Chooses the environment and the goal.
        out: Folder for demo.html, density.png, path.png and demo.json.
        attempts: How many reaches at the most.
        say: Gets a line for every step.

    Raises:
        LicError: The folder cannot be written, or the method or library cannot be used.
    """
    needs_library(method)
    _make_folder(out)
    arm = planar_arm_of(scenario)
    starts = StartSet(arm=arm, line=scenario.task.start_line)
    instance = scenario.sample_instance("evaluation", seed)
    draws = (scenario.sample_goal("evaluation", seed, index) for index in itertools.count())
    p_WG = next(goal for goal in draws if is_within_reach(scenario, goal))
    columns = library.columns()
    say(
        f"{scenario.category}, evaluation environment {seed}: goal at"
        f" ({p_WG[0]:.3f}, {p_WG[1]:.3f}) m; learning from {library.num_reaches} reaches"
    )
    selector = make_selector(method, arm, columns, np.random.default_rng(seed))

    recording = ReachRecording(scenario, instance)
    done: list[tuple[Attempt, ReachTrace]] = []
    for number in range(1, attempts + 1):
        failed = tuple(attempt.selection.x0 for attempt, _ in done)
        selection = selector.select(Situation(p_WG=p_WG, starts=starts, failed=failed))
        estimate = (
            ""
            if selection.probability is None
            else f", estimated success {100 * selection.probability:.0f} %"
        )
        say(
            f"attempt {number}: {method} starts at y {selection.x0[1]:+.3f} m, phi"
            f" {np.rad2deg(selection.x0[2]):+.1f} degrees{estimate}"
            f" (chosen in {selection.seconds:.2f} s)"
        )
        request = make_request(scenario, "evaluation", seed, p_WG, selection.x0)
        began = time.perf_counter()
        result = recording.add_reach(selection.x0, p_WG)
        record = make_record(request, result, time.perf_counter() - began)
        say(
            f"attempt {number}: {record.outcome} after {record.duration_s:.1f} s, nearest to the"
            f" goal {1000 * record.min_distance:.0f} mm, peak force {record.peak_force:.1f} N,"
            f" simulated in {record.wall_time_s:.1f} s"
        )
        done.append((Attempt(selection=selection, request=request, record=record), result.trace))
        if record.success:
            break

    files = {
        "recording": out / "demo.html",
        "density": out / "density.png",
        "path": out / "path.png",
        "data": out / "demo.json",
    }
    recording.save(files["recording"])
    labels = [f"{_ordinal(i)} start: {a.record.outcome}" for i, (a, _) in enumerate(done)]
    if isinstance(selector, LicSelector):
        estimator, estimator_name = selector.estimator, method
    else:
        rows = PLANAR_LIC1.rows(columns)
        estimator_name = "gp"
        estimator = make_estimator(estimator_name).fit(rows.Z, rows.f, rows.environment)
    _save_density(
        files["density"],
        estimator,
        estimator_name,
        starts,
        p_WG,
        [(label, a.selection.x0) for label, (a, _) in zip(labels, done, strict=True)],
    )
    figure = Figure(figsize=(7, 7))
    draw_top_view(
        figure.subplots(),
        scenario,
        instance,
        p_WG,
        [(label, trace) for label, (_, trace) in zip(labels, done, strict=True)],
    )
    save_figure(figure, files["path"])
    demonstration = Demonstration(p_WG=p_WG, attempts=[attempt for attempt, _ in done], files=files)
    _write_json(demonstration, method, seed)
    return demonstration


def _make_folder(out: Path) -> None:
    """Makes the folder and sees that files can be written there, before any work starts."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / ".write-test"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise LicError(
            f"cannot write into {out}: {error.strerror}; choose another folder with --out"
        ) from None


def _save_density(
    path: Path,
    estimator: SuccessEstimator,
    method: str,
    starts: StartSet,
    p_WG: Vector,
    choices: list[tuple[str, Vector]],
) -> None:
    line = starts.line
    y = np.linspace(line.lower[1], line.upper[1], DENSITY_SHAPE[0])
    phi = np.linspace(line.lower[2], line.upper[2], DENSITY_SHAPE[1])
    grid = np.array([[line.x_m, yi, phi_i] for yi in y for phi_i in phi])
    possible = np.array([starts.arm.solve_ik(x0) is not None for x0 in grid])
    probability = np.full(len(grid), np.nan)
    prediction = estimator.predict(PLANAR_LIC1.join(p_WG, grid[possible]))
    probability[possible] = prediction.probability
    figure = Figure(figsize=(7, 4.5))
    ax = draw_density(figure.subplots(), grid, probability, DENSITY_SHAPE, choices)
    ax.set_title(f"LIC-1 ({method}), goal ({p_WG[0]:.2f}, {p_WG[1]:.2f}) m", fontsize=10)
    save_figure(figure, path)


def _write_json(result: Demonstration, method: str, seed: int) -> None:
    content = {
        "method": method,
        "seed": seed,
        "goal": result.p_WG.tolist(),
        "success": result.attempts[-1].record.success,
        "attempts": [
            {
                "start": attempt.selection.x0.tolist(),
                "estimated_success": attempt.selection.probability,
                "selection_s": attempt.selection.seconds,
                "record": asdict(attempt.record),
            }
            for attempt in result.attempts
        ],
        "files": {kind: str(path) for kind, path in result.files.items()},
    }
    result.files["data"].write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _ordinal(index: int) -> str:
    return ("first", "second", "third", "fourth", "fifth")[index]
