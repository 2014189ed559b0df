"""`train`: collects where the estimate so far says so, learns and compares, within a budget."""

import math
import time
from collections.abc import Callable
from pathlib import Path

from lic_drake.evaluate.trial import Evaluation, run_evaluation
from lic_drake.evaluate.trials import TrialRow
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.experience.workers import Workers
from lic_drake.paths import TRAINED
from lic_drake.reach.scenario import load_scenario

LEARNING, BEGINNING = 0.6, 0.95
"""Shares of the budget after which the evaluation begins, and after which no environment does."""

GOALS = 4
"""Goals in each environment of a round, where it has so many."""

LEAST, GROWTH = 8, 4
"""Environments of the first round; later ones have 1 for so many before, but no fewer."""

MANY = 10_000
"""Environments that no evaluation by time comes to the end of."""

METHODS = ("rnd", "cost", "gp")
"""Strategies that the evaluation compares."""


def training_library(folder: Path) -> ExperienceLibrary:
    """Returns the library that a training in a folder learns from."""
    return ExperienceLibrary(folder / TRAINED)


def train(
    folder: Path,
    scenario_name: str,
    overrides: str = "",
    *,
    minutes: float | None = None,
    reaches: int | None = None,
    workers: Workers | None = None,
    say: Callable[[str], None] = print,
) -> list[TrialRow]:
    """Trains and compares, and returns the trials of two attempts in unseen environments.

    COST proposes the starts of the first round, and then the estimate that was learned so far;
    all rounds are in new environments. A folder of an earlier training is gone on with.

    Args:
        folder: Folder of the library, see `training_library`, and of the evaluation.
        scenario_name: Name or path of the scenario.
        overrides: YAML text merged into it.
        minutes: The budget: time from now on, or
        reaches: about so many reaches, with those of earlier trainings.
        workers: Where reaches are simulated; by default in this process.
        say: Receives progress messages.

    Raises:
        LicError: The scenario, or that of the folder, is another, or an environment failed.
    """
    scenario, began_s = load_scenario(scenario_name, overrides), time.monotonic()
    library = training_library(folder)
    library.create()
    library.check_scenario(scenario, "the training")

    def is_spent(share: float) -> bool:
        if reaches is not None:
            return len(library.successes()) >= share * reaches
        return time.monotonic() - began_s >= share * 60.0 * (minutes or 0.0)

    def run(results: str, is_over: Callable[[], bool] | None, **values: object) -> list[TrialRow]:
        evaluation = Evaluation(
            experience=library.path,
            results=folder / results,
            scenario_name=scenario_name,
            overrides=overrides,
            **values,  # type: ignore[arg-type]
        )
        return run_evaluation(evaluation, workers, say, is_over)

    while not (held := len(library.successes())) or not is_spent(LEARNING):
        tried = 1 + int(library.columns()["environment"].max()) if held else 0
        method, environments = "gp" if held else "cost", max(LEAST, tried // GROWTH)
        of = "" if reaches is None else f" of {math.ceil(LEARNING * reaches)}"
        won = sum(library.successes().values())
        say(f"{held}{of} reaches, {won} reached; up to {environments} environments with {method}")
        run(
            "learning",
            lambda: is_spent(LEARNING),
            methods=(method,),
            stream="training",
            first=tried,
            environments=environments,
            goals=1 if scenario.task.goal_area is None else GOALS,
            attempts=1,  # The library is of reaches into untouched environments.
            variant=f"from environment {tried}",
        )
    say(f"{len(library.successes())} reaches; {', '.join(METHODS)} on unseen environments")
    if reaches is None:
        compared = {"methods": METHODS, "environments": MANY, "goals": 1}
        return run("evaluation", lambda: is_spent(BEGINNING), **compared)
    environments = math.ceil((1.0 - LEARNING) * reaches / (2 * len(METHODS)))
    return run("evaluation", None, methods=METHODS, environments=environments, goals=1)
