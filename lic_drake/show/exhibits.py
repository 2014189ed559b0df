"""Chosen reaches for a gallery: per category, the first trials that succeed and that fail."""

import io
import itertools
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lic_drake.errors import LicError
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.experience.added import added_columns
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.request import is_within_reach
from lic_drake.reach.rollout import simulate_request
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.starts import make_starts
from lic_drake.select.registry import make_selector
from lic_drake.show.embed import read_page
from lic_drake.show.plots import draw_top_view
from lic_drake.show.recording import ReachRecording
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 300
"""Environments that are tried before a library counts as one without failures, or successes."""

STREAM = "evaluation"
"""Seed stream of the environments; none of them is in a library."""


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A trial to be shown.

    Attributes:
        scenario: What it took place in.
        environment: Index of the environment in the stream `STREAM`.
        p_WG: Goal, shape (3,), metres.
        attempts: The attempts in their order.
        recording: All attempts as a page that plays offline.
        still: View from above with all attempts, a PNG image.
    """

    scenario: Scenario
    environment: int
    p_WG: Vector
    attempts: list[Attempt]
    recording: str
    still: bytes

    @property
    def success(self) -> bool:
        """Whether the last attempt reached the goal."""
        return self.attempts[-1].record.success


def choose_exhibits(
    library: ExperienceLibrary,
    method: str = "gp",
    each: int = 1,
    first_environment: int = 0,
    attempts: int = 2,
    say: Callable[[str], None] = print,
) -> list[Exhibit]:
    """Returns the first trials that reach their goal and the first that do not.

    Environments are taken in their order, so that nothing is chosen by its looks; those whose goal
    is farther away than the arm is long are passed over.

    Args:
        library: Experience to learn from; it says the scenario.
        method: Strategy, see `lic_drake.select.registry.method_names`.
        each: How many successes and how many failures.
        first_environment: Index of the environment to begin with.
        attempts: How many attempts at a goal at the most.
        say: Gets a line for every exhibit.

    Raises:
        LicError: The method or the library cannot be used.
    """
    scenario = library.scenario()
    arm = scenario.arm()
    rng = np.random.default_rng(first_environment)
    selector = make_selector(
        method, arm, library.columns(), rng, scenario.category, added=added_columns(library)
    )
    wanted = {True: each, False: each}
    found = []
    for environment, p_WG in itertools.islice(
        _reachable_goals(scenario, first_environment), MAX_ENVIRONMENTS
    ):
        done = run_trial(scenario, selector, STREAM, environment, p_WG, attempts)
        success = done[-1].record.success
        if wanted[success] == 0:
            continue
        wanted[success] -= 1
        found.append(_exhibit(scenario, environment, p_WG, done))
        say(
            f"{scenario.category}, environment {environment}:"
            f" {', '.join(attempt.record.outcome for attempt in done)}"
        )
        if not any(wanted.values()):
            break
    return sorted(found, key=lambda exhibit: not exhibit.success)


def _reachable_goals(scenario: Scenario, first: int) -> Iterator[tuple[int, Vector]]:
    """Yields environments with their goals, those that the arm is long enough for."""
    for environment in itertools.count(first):
        p_WG = scenario.sample_goal(STREAM, environment)
        starts = make_starts(scenario, scenario.sample_instance(STREAM, environment))
        bases = np.unique(starts.grid.b0[:, :2], axis=0)
        if any(is_within_reach(scenario, p_WG - [*base, 0.0]) for base in bases):
            yield environment, p_WG


def _exhibit(scenario: Scenario, environment: int, p_WG: Vector, done: list[Attempt]) -> Exhibit:
    """Simulates the attempts of a trial again, with all that is to be seen of them."""
    instance = scenario.sample_instance(STREAM, environment)
    traces = [simulate_request(attempt.request, keep_states=True).trace for attempt in done]
    recording = ReachRecording(scenario, instance)
    for trace in traces:
        recording.add_reach(trace, p_WG)
    labels = [f"{i}: {attempt.record.outcome}" for i, attempt in enumerate(done, start=1)]
    figure = Figure(figsize=(6, 6.4), layout="constrained")
    draw_top_view(
        figure.subplots(), scenario, instance, p_WG, list(zip(labels, traces, strict=True))
    )
    still = io.BytesIO()
    figure.savefig(still, format="png", dpi=80)
    try:
        with tempfile.TemporaryDirectory() as folder:
            recording.save(Path(folder) / "recording.html")
            page = read_page(Path(folder) / "recording.html")
    except OSError as error:
        raise LicError(f"cannot write a temporary file: {error.strerror}") from None
    return Exhibit(
        scenario=scenario,
        environment=environment,
        p_WG=p_WG,
        attempts=done,
        recording=page,
        still=still.getvalue(),
    )
