"""The demonstration: select, reach, record, and show what was estimated."""

import itertools
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lic_drake.errors import LicError
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.experience.added import added_columns
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.perception.cameras import make_renderer
from lic_drake.perception.config import CamerasConfig
from lic_drake.perception.observer import Observer
from lic_drake.reach.pointing_starts import PointingStarts
from lic_drake.reach.request import ReachRecord, ReachRequest, is_within_reach
from lic_drake.reach.rollout import make_record, simulate_request
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.start import IN_PLANE
from lic_drake.reach.starts import Starts, make_starts
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import Selector, make_selector, needs_library
from lic_drake.select.situation import Selection, Situation
from lic_drake.show.looking_pictures import LookingPictures
from lic_drake.show.pictures import AperturePictures, Pictures, PlanarPictures
from lic_drake.show.pr2_meshes import LinkMesh
from lic_drake.show.stills import save_stills
from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Demonstration:
    """What was done and where it can be seen.

    Attributes:
        p_WG: Goal, shape (3,), metres.
        attempts: The attempts in their order.
        success: Whether the last of them came to the goal, or with cameras into the ball.
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
    meshes: Sequence[LinkMesh] = (),
    cameras: CamerasConfig | None = None,
) -> Demonstration:
    """Selects a start in an unseen environment, reaches, and tries again if that fails.

    Args:
        scenario: Where to reach, the library's scenario or one with the same robot.
        library: Experience to learn from; its environments come from another seed stream.
        method: Strategy, see `lic_drake.select.registry.method_names`.
        seed: Chooses the environment and the goal.
        out: Folder for demo.html, demo.json, path.png, the stills of `save_stills` and, in the
            plane, density.png, before a board of apertures apertures.png; with cameras also
            sequence.html, views.webp, look1.png and so on. Those of an earlier demonstration there
            are removed.
        attempts: How many reaches at the most.
        say: Gets a line for every step.
        meshes: What a PR2 wears in the pictures instead of the shapes of its model.
        cameras: Cameras with which a PR2 has to find apertures and goal before every attempt; None:
            it knows them.

    Raises:
        LicError: The folder cannot be written, or the method or library cannot be used.
        RenderingError: There are cameras, which cannot be simulated on this machine.
    """
    needs_library(method)
    _make_folder(out)
    if cameras is not None:
        make_renderer()  # Before the library is learned from.
    arm = scenario.arm()
    instance = scenario.sample_instance("evaluation", seed)
    starts = make_starts(scenario, instance)
    draws = (scenario.sample_goal("evaluation", seed, index) for index in itertools.count())
    p_WG = next(goal for goal in draws if _can_be_reached(scenario, starts, goal))
    columns, added = library.columns(), added_columns(library)
    say(
        f"{scenario.category}, evaluation environment {seed}: goal at"
        f" {_metres(p_WG[:2] if arm.surface is None else p_WG)} m; learning from"
        f" {library.num_reaches} reaches of {library.scenario().category}"
    )
    selector = _Talking(
        make_selector(
            method, arm, columns, np.random.default_rng(seed), scenario.category, added=added
        ),
        say,
    )
    observer = None
    if cameras is not None:
        observer = Observer(
            scenario=scenario, stream="evaluation", environment=seed, p_WG=p_WG, cameras=cameras
        )
        pictures: Pictures = LookingPictures(instance, observer, meshes)
    elif isinstance(starts, PointingStarts):
        pictures = AperturePictures(scenario, instance, starts, p_WG, meshes)
    else:
        pictures = PlanarPictures(scenario, instance, starts, p_WG)

    traces: list[ReachTrace] = []

    def reach(request: ReachRequest) -> ReachRecord:
        began = time.perf_counter()
        result = simulate_request(request, keep_states=True)
        record = make_record(request, result, time.perf_counter() - began)
        pictures.add(request, record, result.trace)
        traces.append(result.trace)
        say(
            f"attempt {pictures.num_attempts}: {record.outcome} after {record.duration_s:.1f} s,"
            f" nearest to the goal {1000 * record.min_distance:.0f} mm, peak force"
            f" {record.peak_force:.1f} N, simulated in {record.wall_time_s:.1f} s"
        )
        return record

    def look(number: int) -> tuple[Vector, Starts]:
        assert observer is not None
        belief = observer.belief(number)
        off = 1000 * np.linalg.norm(belief.p_WG - p_WG)
        say(
            f"look {number + 1}: {len(belief.index)} of {len(belief.look.apertures.p_WA)} apertures"
            f" look open, the ball is at {_metres(belief.p_WG)} m, which is"
            f" {off:.0f} mm off"
        )
        return belief.p_WG, belief.starts

    done = run_trial(
        scenario,
        selector,
        "evaluation",
        seed,
        p_WG,
        attempts,
        reach=reach,
        look=None if observer is None else look,
    )
    chosen = selector.selector
    if not isinstance(chosen, LicSelector):  # Shows what LIC would have thought of the choices.
        chosen = make_selector("gp", arm, columns, category=scenario.category, added=added)
    assert isinstance(chosen, LicSelector)
    _remove_pictures(out)
    files = {**pictures.save(out, chosen, done), "data": out / "demo.json"}
    files |= save_stills(scenario, instance, p_WG, done, traces, out, say, meshes)
    last = done[-1].record
    success = last.success if observer is None else observer.touches_ball(last)
    demonstration = Demonstration(p_WG=p_WG, attempts=done, success=success, files=files)
    _write_json(demonstration, method, seed)
    return demonstration


@dataclass(frozen=True)
class _Talking:
    """A strategy that says what it chose."""

    selector: Selector
    say: Callable[[str], None]

    @property
    def method(self) -> str:
        """Name of the strategy."""
        return self.selector.method

    def select(self, situation: Situation) -> Selection:
        """Chooses an initial condition."""
        selection = self.selector.select(situation)
        estimate = (
            ""
            if selection.probability is None
            else f", estimated success {100 * selection.probability:.0f} %"
        )
        self.say(
            f"attempt {len(situation.failed) + 1}: {self.method} starts at"
            f" {_start(selection)}{estimate} (chosen in {selection.seconds:.2f} s)"
        )
        return selection


def _start(selection: Selection) -> str:
    """Returns an initial condition in words."""
    x0, (x, y, torso) = selection.start.x0, selection.start.b0
    base = f", base at y {y:+.3f} m" if x or y else ""
    if len(x0) == IN_PLANE:
        return f"y {x0[1]:+.3f} m, phi {np.rad2deg(x0[2]):+.1f} degrees{base}"
    return f"the aperture at {_metres(x0[:3])} m{base}, torso at {torso:.3f} m"


def _metres(position: Vector) -> str:
    return "(" + ", ".join(f"{value:.3f}" for value in position) + ")"


def _can_be_reached(scenario: Scenario, starts: Starts, p_WG: Vector) -> bool:
    """Tells whether a goal is near enough to one of the places where base and torso may be."""
    return any(
        is_within_reach(scenario, p_WG - [x, y, 0.0], torso_m)
        for x, y, torso_m in np.unique(starts.grid.b0, axis=0)
    )


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


def _remove_pictures(out: Path) -> None:
    """Removes an earlier demonstration's pictures, some of which this one may not have."""
    for pattern in ("density.png", "apertures.png", "look[1-9].png", "views.webp", "sequence.html"):
        for old in out.glob(pattern):
            old.unlink()


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
