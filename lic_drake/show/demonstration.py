"""The demonstration: select, reach, record, and show what was estimated."""

import itertools
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lic_drake.errors import check_writable
from lic_drake.evaluate.reliability import read_reliability
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.perception.cameras import make_renderer
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.observer import Observer
from lic_drake.reach.request import ReachRecord, ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import make_record, simulate_request
from lic_drake.reach.start import describe_start
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import Selector, make_selector, needs_library
from lic_drake.show.figures import ShownTrial, is_reachable
from lic_drake.show.pictures import index_page, remove_pictures, save_pictures
from lic_drake.starts import FeasibleStarts, make_starts
from lic_drake.types import Vector

STREAM = "evaluation"
"""Seed stream of the environment; none of its environments is in a library."""


@dataclass(frozen=True, kw_only=True)
class Demonstration:
    """What was done and written.

    Attributes:
        success: Whether the last attempt reached the goal, or with cameras the ball.
        files: What was written, by kind: recording, pictures and data.
    """

    p_WG: Vector
    attempts: list[Attempt]
    success: bool
    files: dict[str, Path]


def demonstrate(
    scenario: Scenario,
    library: ExperienceLibrary,
    method: str,
    seed: int,
    out: Path,
    attempts: int = 2,
    say: Callable[[str], None] = print,
    drake_models: Path | None = None,
    cameras: CamerasConfig | None = None,
) -> Demonstration:
    """Selects a start in an unseen environment, reaches, and tries again if that fails.

    Args:
        scenario: The library's scenario, or another one with the same robot.
        library: Experience to learn from; its environments come from another seed stream.
        method: Strategy, see `lic_drake.select.registry.check_method`.
        seed: Chooses the environment and the goal.
        out: Folder for demo.html, demo.json and the files of
            `lic_drake.show.pictures.save_pictures`; those of an earlier demonstration are removed.
        attempts: Largest number of reaches.
        say: Receives progress messages.
        drake_models: See `lic_drake.show.stage.add_stage`.
        cameras: Cameras with which a PR2 detects apertures and goal before every attempt; by
            default both are known.

    Raises:
        LicError: The folder cannot be written, or the method or library cannot be used.
        RenderingError: There are cameras, which cannot be simulated on this machine.
    """
    needs_library(method)
    check_writable(out)
    if cameras is not None:
        make_renderer()  # Fails before the library is learned from.
    instance = scenario.sample_instance(STREAM, seed)
    say(f"{scenario.category}, evaluation environment {seed}: looking for starts")
    draws = (scenario.sample_goal(STREAM, seed, index) for index in itertools.count())
    p_WG = next(goal for goal in draws if is_reachable(scenario, STREAM, seed, goal))
    say(
        f"goal at {_metres(p_WG)} m; learning from {library.num_reaches} reaches of"
        f" {library.scenario().category}"
    )

    def select_with(name: str) -> Selector:
        rng = np.random.default_rng(seed)
        return make_selector(name, library.columns(), rng, say)

    selector = select_with(method)
    observer = None
    if cameras is not None:
        observer = Observer(
            scenario=scenario, stream=STREAM, environment=seed, p_WG=p_WG, cameras=cameras
        )
    known = make_starts(scenario, instance)
    traces: list[ReachTrace] = []

    def look(number: int) -> tuple[Vector, FeasibleStarts]:
        if observer is None:
            return p_WG, known
        belief = observer.belief(number)
        seen = belief.goal.p_WG
        say(
            f"look {number + 1}: {len(belief.open_index)} of {len(belief.apertures.p_WA)} apertures"
            f" look open, the ball is detected at {_metres(seen)} m,"
            f" {1000 * np.linalg.norm(seen - p_WG):.0f} mm off"
        )
        return seen, belief.starts

    def reach(request: ReachRequest) -> ReachRecord:
        say(f"attempt {len(traces) + 1}: starts at {describe_start(request.start)}")
        began = time.perf_counter()
        result = simulate_request(request, keep_states=True)
        record = make_record(request, result, time.perf_counter() - began)
        traces.append(result.trace)
        say(
            f"attempt {len(traces)}: {record.outcome} after {record.duration_s:.1f} s, nearest to"
            f" the goal {1000 * record.min_distance:.0f} mm, peak force {record.peak_force:.1f} N,"
            f" simulated in {record.wall_time_s:.1f} s"
        )
        return record

    done = run_trial(scenario, selector, STREAM, seed, p_WG, attempts, reach=reach, look=look)
    for number, selection in enumerate((attempt.selection for attempt in done), start=1):
        if selection.probability is not None:
            line = f"attempt {number}: estimated success {100 * selection.probability:.0f} %"
            reliable = read_reliability(library.path, method, number)
            if reliable is not None and library.scenario().category == scenario.category:
                low, high = reliable.interval(selection.probability)
                line += f"; such choices succeed in {100 * low:.0f} to {100 * high:.0f} %"
            say(line)
    # For a baseline, the pictures show what LIC would have estimated.
    shown = selector if isinstance(selector, LicSelector) else select_with("gp")
    assert isinstance(shown, LicSelector)
    trial = ShownTrial(
        scenario=scenario, instance=instance, p_WG=p_WG, attempts=done, traces=traces
    )
    remove_pictures(out)
    files = save_pictures(trial, shown, observer or known, out, say, drake_models)
    last = done[-1].record
    result = Demonstration(
        p_WG=p_WG,
        attempts=done,
        success=last.success if observer is None else observer.touches_ball(last),
        files={**files, "data": out / "demo.json", "index": out / "index.html"},
    )
    _write_json(result, method, seed)
    word = "reached" if result.success else "not reached"
    page = index_page(f"{scenario.category}, environment {seed}: {word}", done, result.files)
    result.files["index"].write_text(page, encoding="utf-8")
    return result


def _metres(position: Vector) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in position) + ")"


def _write_json(result: Demonstration, method: str, seed: int) -> None:
    content = {
        "method": method,
        "seed": seed,
        "goal": result.p_WG.tolist(),
        "success": result.success,
        "attempts": [
            {
                "start": attempt.selection.start.x0.tolist(),
                "estimated_success": attempt.selection.probability,
                "selection_s": attempt.selection.seconds,
                "record": asdict(attempt.record),
            }
            for attempt in result.attempts
        ],
        "files": {kind: str(path) for kind, path in result.files.items()},
    }
    result.files["data"].write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
