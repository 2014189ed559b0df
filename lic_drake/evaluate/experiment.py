"""Trials of several strategies on the same unseen environments, resumable."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from lic_drake.evaluate.batch import simulate_requests
from lic_drake.evaluate.trial import planar_arm_of
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.intervals import wilson_interval
from lic_drake.reach.request import ReachRecord, ReachRequest, make_request
from lic_drake.reach.scenario import Scenario
from lic_drake.seeds import make_generator
from lic_drake.select.registry import make_selector, needs_library
from lic_drake.select.situation import Selection, Situation, StartSet


@dataclass(frozen=True, kw_only=True)
class Trial:
    """The attempts of one strategy at one goal, in their order."""

    method: str
    environment: int
    goal: int
    selections: tuple[Selection, ...]
    records: tuple[ReachRecord, ...]

    def success(self, attempts: int) -> bool:
        """Tells whether one of the first `attempts` attempts reached the goal."""
        return any(record.success for record in self.records[:attempts])


def run_trials(
    scenario: Scenario,
    experience: ExperienceLibrary,
    results: Path,
    methods: Sequence[str],
    environments: int,
    goals: int,
    attempts: int = 1,
    workers: int = 1,
    say: Callable[[str], None] = print,
) -> list[Trial]:
    """Runs every strategy on the same goals in the same evaluation environments.

    Reaches are kept in a library under `results` and not simulated again. Every attempt finds
    the environment as it was drawn.

    Args:
        scenario: The experience library's scenario.
        experience: What the strategies learn from.
        results: Folder of the library of evaluation reaches.
        methods: Strategies, see `lic_drake.select.registry.method_names`.
        environments: Number of evaluation environments, from index 0.
        goals: Number of random goals in each.
        attempts: How many attempts at a goal at the most.
        workers: Number of processes.
        say: Gets a line now and then.

    Raises:
        LicError: A method is unknown, or a library cannot be read or written.
    """
    columns = experience.columns() if any(needs_library(method) for method in methods) else None
    arm = planar_arm_of(scenario)
    starts = StartSet(arm=arm, line=scenario.task.start_line)
    trials = [
        Trial(method=method, environment=e, goal=g, selections=(), records=())
        for method in methods
        for e in range(environments)
        for g in range(goals)
    ]
    library = ExperienceLibrary(results)
    library.create()
    for attempt in range(attempts):
        open_trials = [trial for trial in trials if not trial.success(attempt)]
        chosen: list[tuple[Trial, Selection, ReachRequest]] = []
        for method in methods:
            selector = make_selector(method, arm, columns, np.random.default_rng(0))
            for trial in (trial for trial in open_trials if trial.method == method):
                p_WG = scenario.sample_goal("evaluation", trial.environment, trial.goal)
                if method == "rnd":
                    # A draw of its own for every trial: independent of how many others there are.
                    rng = make_generator(
                        "evaluation", "rnd", trial.environment, trial.goal, attempt
                    )
                    selector = make_selector(method, arm, columns, rng)
                failed = tuple(selection.x0 for selection in trial.selections)
                situation = Situation(p_WG=p_WG, starts=starts, failed=failed)
                selection = selector.select(situation)
                request = make_request(
                    scenario, "evaluation", trial.environment, p_WG, selection.x0
                )
                chosen.append((trial, selection, request))
        say(f"attempt {attempt + 1}: {len(chosen)} starts chosen")
        records = simulate_requests([c[2] for c in chosen], library, scenario, workers, say)
        extended = {
            (trial.method, trial.environment, trial.goal): Trial(
                method=trial.method,
                environment=trial.environment,
                goal=trial.goal,
                selections=(*trial.selections, selection),
                records=(*trial.records, records[request.key]),
            )
            for trial, selection, request in chosen
        }
        trials = [extended.get((t.method, t.environment, t.goal), t) for t in trials]
    return trials


@dataclass(frozen=True, kw_only=True)
class Rate:
    """A strategy's success rate after a number of attempts.

    Attributes:
        method: Name of the strategy.
        attempts: How many attempts count.
        successes: Trials that reached the goal.
        trials: All trials.
        p_value: Of McNemar's exact paired test against RND on the same goals; NaN for RND.
    """

    method: str
    attempts: int
    successes: int
    trials: int
    p_value: float


def summarize_trials(trials: Sequence[Trial], attempts: int) -> list[Rate]:
    """Returns the success rate of each strategy after 1 to `attempts` attempts."""
    methods = list(dict.fromkeys(trial.method for trial in trials))
    rates = []
    for count in range(1, attempts + 1):
        won = {
            method: np.array([t.success(count) for t in trials if t.method == method])
            for method in methods
        }
        for method in methods:
            rates.append(
                Rate(
                    method=method,
                    attempts=count,
                    successes=int(won[method].sum()),
                    trials=len(won[method]),
                    p_value=mcnemar(won[method], won["rnd"])
                    if "rnd" in won and method != "rnd"
                    else float("nan"),
                )
            )
    return rates


def mcnemar(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Returns the p-value of McNemar's exact test for paired successes, shape (n,) each."""
    only_a, only_b = int(np.sum(a & ~b)), int(np.sum(b & ~a))
    if only_a + only_b == 0:
        return 1.0
    return float(binomtest(only_a, only_a + only_b).pvalue)


def format_rates(rates: Sequence[Rate]) -> str:
    """Returns the rates as a Markdown table."""
    lines = [
        "| strategy | attempts | success, % | 90 % interval | trials | p against RND |",
        "|---|---|---|---|---|---|",
    ]
    for rate in rates:
        low, high = wilson_interval(rate.successes, rate.trials)
        p = "" if np.isnan(rate.p_value) else f"{rate.p_value:.2g}"
        lines.append(
            f"| {rate.method} | {rate.attempts} | {100 * rate.successes / rate.trials:.1f} |"
            f" {100 * low:.1f}..{100 * high:.1f} | {rate.trials} | {p} |"
        )
    return "\n".join(lines) + "\n"
