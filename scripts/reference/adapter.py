"""The package as the reference sees it: plain requests and situations in, plain results out.

Only this file follows changes of the package's API.
"""

import dataclasses
from functools import cache
from typing import Any

import numpy as np

from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import run_reach
from lic_drake.reach.start import POSE_AXES, Start
from lic_drake.seeds import make_generator
from lic_drake.select.baselines import RandomSelector
from lic_drake.select.registry import Selector, make_selector, needs_library
from lic_drake.select.situation import FailedReach, Situation
from lic_drake.starts import make_starts

OVERRIDES = {"sphere-aperture-clutter": "{clutter: {num_blocked: 10}}"}
"""What the evaluations put over a library's scenario."""


@cache
def _library(category: str) -> ExperienceLibrary:
    return ExperienceLibrary(shipped_library(category))


def simulate(category: str, row: dict[str, Any]) -> dict[str, Any]:
    """Returns the columns of a row of a shipped library, simulated again."""
    spatial = any(row[f"start_q{axis}"] for axis in "wxyz")
    x0 = [row[f"start_{axis}"] for axis in POSE_AXES[7 if spatial else 3]]
    b0 = [row["base_x"], row["base_y"], row["torso"]]
    request = ReachRequest(
        _library(category).scenario(),
        row["stream"],
        row["environment"],
        np.array([row[f"goal_{axis}"] for axis in "xyz"]),
        Start(np.array(x0), np.array(b0)),
    )
    return dataclasses.asdict(run_reach(request))


@cache
def _scenario(category: str) -> Scenario:
    return _library(category).scenario(OVERRIDES.get(category, ""))


@cache
def _selector(category: str, method: str) -> Selector:
    columns = _library(category).columns() if needs_library(method) else None
    return make_selector(method, _scenario(category).arm(), columns, category=category)


def select(situation: dict[str, Any]) -> dict[str, Any]:
    """Returns start, base, torso and estimate that a strategy chooses in a stored situation."""
    category, method, environment = (situation[k] for k in ("category", "method", "environment"))
    scenario = _scenario(category)
    instance = scenario.sample_instance("evaluation", environment)
    starts = make_starts(scenario, instance, situation["moves"])
    selector = _selector(category, method)
    first: tuple[FailedReach, ...] = ()
    if method == "rnd":
        selector = RandomSelector(rng=make_generator("evaluation", "rnd", environment, 0))
    goal = np.array(situation["goal"])
    if situation["failed"] is not None:
        if method == "rnd":  # The second draw follows the first.
            selector.select(Situation(p_WG=goal, starts=starts))
        failed = situation["failed"]
        start = Start(np.array(failed["x0"]), np.array(failed["b0"]))
        first = (FailedReach(start=start, shown=failed["shown"]),)
    chosen = selector.select(Situation(p_WG=goal, starts=starts, failed=first))
    q = None if chosen.start.q is None else chosen.start.q.tolist()
    return {
        "x0": chosen.start.x0.tolist(),
        "b0": chosen.start.b0.tolist(),
        "q": q,
        "probability": chosen.probability,
    }
