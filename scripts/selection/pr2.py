"""Selection for the PR2 against exhaustive sampling: feasibility, estimates and times.

First attempts are LIC-1's; second ones are LIC-2's after the first, of the MathematicalProgram,
failed.

python scripts/selection/pr2.py --situations 100 --out notebooks/results/selection_pr2.md
"""

import argparse
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lic_drake.errors import LicError, RequestError
from lic_drake.estimate.features import features_of
from lic_drake.evaluate.table import Table
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.pointing_starts import ROBOT_TO_CLUTTER, PointingStarts, pointing_starts
from lic_drake.reach.scenario import parse_scenario
from lic_drake.reach.start import Starts
from lic_drake.robots.pr2_kinematics import Pr2Kinematics
from lic_drake.seeds import make_generator
from lic_drake.select.objective import SuccessModel, SuccessObjective
from lic_drake.select.pointing_lic import PointingLbfgsb, PointingLic, is_apart
from lic_drake.select.registry import fit_model
from lic_drake.select.situation import FailedReach, Selection, Situation
from lic_drake.types import Vector

OPTIMISERS = {"MathematicalProgram": PointingLic, "L-BFGS-B": PointingLbfgsb}


class Outcome(NamedTuple):
    """One selection beside samples and grid: estimates, -inf for none, and seconds by stage."""

    best_sample: float
    best_of_grid: float
    value: float
    starts_s: float
    candidates_s: float
    optimisation_s: float


Key = tuple[str, int, str]
"""Estimator, attempt, optimiser."""


def sample_conditions(starts: PointingStarts, count: int, rng: np.random.Generator) -> Starts:
    """Returns what is within reach among random apertures, bases, torsos and pan angles.

    The last stand for configurations: each leaves at most two. Whether the arm touches anything is
    left open.
    """
    stand = starts.stand
    arm = starts.scenario.arm()
    kinematics = arm.kinematics
    assert isinstance(kinematics, Pr2Kinematics)
    p_WA = starts.p_WA[rng.integers(len(starts.p_WA), size=count)]
    y_m = rng.uniform(stand.y_min_m, stand.y_max_m, count)
    torso_m = rng.uniform(stand.torso_min_m, stand.torso_max_m, count)
    pan = np.sort(rng.uniform(arm.q_min[0], arm.q_max[0], count))
    b0 = np.column_stack([np.zeros(count), y_m, torso_m])
    q, sample = kinematics.solve_at(p_WA - b0, ROBOT_TO_CLUTTER, pan)
    pose = np.array([arm.tip_pose(row) for row in q]).reshape(-1, 7)
    pose[:, :3] = p_WA[sample]
    return Starts(pose, b0[sample])


def best_possible(starts: PointingStarts, samples: Starts, values: Vector) -> float:
    """Returns the highest of the samples' values, shape (n,), that is possible, or -inf.

    From the best on, as the check costs more than the estimate.
    """
    for k in np.argsort(-values):
        if starts.angles(samples.x0[k], samples.b0[k, :2], samples.b0[k, 2]) is not None:
            return float(values[k])
    return -np.inf


def is_possible(starts: PointingStarts, chosen: Selection) -> bool:
    """Returns whether a selection is feasible, by its own angles and by inverse kinematics."""
    x0, b0, q = chosen.start.x0, chosen.start.b0, chosen.start.q
    assert q is not None
    tool = starts.scenario.arm().tip_pose(q)[:3] + b0
    touches = starts.checker.touches(b0, q)
    again = starts.angles(x0, b0[:2], b0[2])
    return bool(np.allclose(tool, x0[:3], atol=1e-6)) and not touches and again is not None


def check_situation(
    models: dict[str, SuccessModel],
    p_WG: Vector,
    starts: PointingStarts,
    samples: int,
    rng: np.random.Generator,
) -> dict[Key, Outcome]:
    """Returns how all strategies fare in one situation, attempt after attempt."""
    began = time.perf_counter()
    grid = starts.grid
    starts.checker  # noqa: B018  It is built when it is asked for; selections share it.
    starts_s = time.perf_counter() - began
    sampled = sample_conditions(starts, samples, rng)
    found: dict[Key, Outcome] = {}
    for name, model in models.items():
        failed: tuple[FailedReach, ...] = ()
        for attempt in (1, 2):
            situation = Situation(p_WG=p_WG, starts=starts, failed=failed)
            objective = PointingLic(model).objective(situation)
            began = time.perf_counter()
            allowed = grid.take(is_apart(situation, grid) & situation.allowed(grid))
            of_grid = float(objective.values(allowed).max(initial=-np.inf))
            candidates_s = time.perf_counter() - began
            others = sampled.take(is_apart(situation, sampled) & situation.allowed(sampled))
            best = best_possible(starts, others, objective.values(others))
            next_failed = failed
            for kind, optimiser in OPTIMISERS.items():
                began, value = time.perf_counter(), -np.inf
                try:
                    chosen = optimiser(model).select(situation)
                except RequestError:
                    optimisation_s = 0.0
                else:
                    optimisation_s = time.perf_counter() - began - candidates_s
                    if is_possible(starts, chosen):
                        value = _value(objective, chosen)
                    if kind == "MathematicalProgram":
                        next_failed = (FailedReach.from_start(chosen.start),)
                found[name, attempt, kind] = Outcome(
                    best, of_grid, value, starts_s, candidates_s, optimisation_s
                )
            failed = next_failed
            if not failed:
                break
    return found


def _value(objective: SuccessObjective, chosen: Selection) -> float:
    condition = Starts.of(chosen.start)
    return float(objective.values(condition)[0])


def make_table(outcomes: dict[Key, list[Outcome]], title: str) -> Table:
    """Returns one row a strategy."""
    rows = []
    for (name, attempt, kind), of_kind in outcomes.items():
        best, grid, value = np.array([outcome[:3] for outcome in of_kind]).T
        stages = np.array([outcome[3:] for outcome in of_kind])
        possible = np.isfinite(best)
        behind = np.maximum(best[possible] - value[possible], 0.0)
        rows.append(
            (
                *(name, str(attempt), kind),
                f"{np.isfinite(value[possible]).sum()} of {possible.sum()}",
                f"{100 * np.mean(behind <= 1e-9):.1f}",
                f"{100 * behind.max(initial=0.0):.2f}",
                f"{100 * np.mean(value >= grid - 1e-9):.1f}",
                f"{100 * np.median((value - grid)[possible]):.2f}",
                *(f"{s:.2f}" for s in np.median(stages, axis=0)),
                *(f"{s:.2f}" for s in (np.median(stages.sum(axis=1)), stages.sum(axis=1).max())),
            )
        )
    return Table(
        caption=title,
        heading=(
            *("estimator", "attempt", "optimiser", "feasible where a sample is"),
            *("estimate at least the best sample's, %", "largest shortfall, points"),
            *("at least the best grid start's, %", "median gain over the grid, points"),
            *("starts, median s", "candidates, median s", "optimisation, median s"),
            *("together, median s", "largest s"),
        ),
        rows=tuple(rows),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=shipped_library("sphere-aperture-clutter"))
    parser.add_argument("--situations", type=int, default=100)
    parser.add_argument("--samples", type=int, default=20_000, help="configurations a situation")
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    parser.add_argument(
        "--blocked", type=int, nargs="+", default=[10, 0], help="numbers of blocked apertures"
    )
    parser.add_argument("--out", type=Path, help="Markdown file")
    args = parser.parse_args()
    try:
        library = ExperienceLibrary(args.library)
        text, columns = scenario_text(library.scenario()), library.columns()
        features = features_of(library.scenario().category).first
        models = {name: fit_model(name, features, columns) for name in args.estimators}
        tables = []
        for blocked in args.blocked:
            scenario = parse_scenario(text, f"{{clutter: {{num_blocked: {blocked}}}}}")
            outcomes: dict[Key, list[Outcome]] = {}
            for i in range(args.situations):
                starts = pointing_starts(
                    scenario, scenario.sample_instance("holdout", i), scenario.task.stand
                )
                p_WG = scenario.sample_goal("holdout", i)
                rng = make_generator("holdout", "configurations", i)
                for key, outcome in check_situation(
                    models, p_WG, starts, args.samples, rng
                ).items():
                    outcomes.setdefault(key, []).append(outcome)
            title = (
                f"{args.situations} situations with {blocked} of {len(starts.all_apertures)}"
                f" apertures blocked, against {args.samples} random apertures, bases, torsos and"
                " configurations in each."
            )
            tables.append(make_table(outcomes, title).to_markdown())
            print(tables[-1], flush=True)
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if args.out:
        head = "# Selections of the PR2 beside exhaustive sampling\n"
        args.out.write_text("\n".join([head, *tables]), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
