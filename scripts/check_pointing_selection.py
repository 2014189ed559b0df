"""Selection for the PR2 against exhaustive sampling: feasibility, estimates and times.

python scripts/check_pointing_selection.py --situations 100 --out notebooks/results/selection_pr2.md
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from lic_drake.errors import RequestError
from lic_drake.estimate.categories import features_of
from lic_drake.experience.schema import scenario_text
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.initial_conditions import InitialConditions
from lic_drake.reach.pointing_starts import PointingStarts, pointing_starts
from lic_drake.reach.scenario import parse_scenario
from lic_drake.robots.pr2 import Pr2Arm
from lic_drake.robots.pr2_inverse import ROBOT_TO_CLUTTER, solve_pointing
from lic_drake.seeds import make_generator
from lic_drake.select.objective import Objective
from lic_drake.select.pointing_lic import PointingLbfgsb, PointingLic
from lic_drake.select.registry import fit_model
from lic_drake.select.situation import Situation

OPTIMISERS = {"MathematicalProgram": PointingLic, "L-BFGS-B": PointingLbfgsb}


def sample_conditions(
    starts: PointingStarts, count: int, rng: np.random.Generator
) -> InitialConditions:
    """Returns the possible ones of so many random apertures, bases, torsos and configurations."""
    stand = starts.stand
    x0, p_WR, torso = [], [], []
    for _ in range(count):
        p_WA = starts.p_WA[rng.integers(len(starts.p_WA))]
        y_m = rng.uniform(stand.y_min_m, stand.y_max_m)
        torso_m = rng.uniform(stand.torso_min_m, stand.torso_max_m)
        arm = starts.scenario.arm().raised(torso_m)
        assert isinstance(arm, Pr2Arm)
        pan = rng.uniform(arm.q_min[0], arm.q_max[0], 1)
        q = solve_pointing(arm.kinematics, p_WA - [0.0, y_m, 0.0], ROBOT_TO_CLUTTER, pan)
        for row in q[:1]:
            pose = arm.tip_pose(row)
            pose[:3] = p_WA
            x0.append(pose)
            p_WR.append([0.0, y_m])
            torso.append(torso_m)
    return InitialConditions(
        np.array(x0).reshape(-1, 7), np.array(p_WR).reshape(-1, 2), np.array(torso)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=shipped_library("sphere-aperture-clutter"))
    parser.add_argument("--situations", type=int, default=100)
    parser.add_argument("--samples", type=int, default=20_000, help="configurations a situation")
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    parser.add_argument("--blocked", type=int, default=10)
    parser.add_argument("--out", type=Path, help="Markdown file")
    args = parser.parse_args()
    library = ExperienceLibrary(args.library)
    scenario = parse_scenario(
        scenario_text(library.scenario()), f"{{clutter: {{num_blocked: {args.blocked}}}}}"
    )
    columns = library.columns()
    lines = [
        f"{args.situations} situations with {args.blocked} of 20 apertures blocked, against"
        f" {args.samples} random apertures, bases, torsos and configurations in each.",
        "",
        "| estimator | optimiser | feasible where a sample is | estimate at least the best"
        " sample's, % | best grid start's, % | median gain over the grid, points | median s |"
        " largest s |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in args.estimators:
        model = fit_model(name, features_of(scenario.category).first, columns)
        results: dict[str, list[tuple[float, ...]]] = {kind: [] for kind in OPTIMISERS}
        for i in range(args.situations):
            p_WG = scenario.sample_goal("holdout", i)
            starts = pointing_starts(
                scenario, scenario.sample_instance("holdout", i), scenario.task.stand
            )
            objective = Objective(model=model, p_WG=p_WG)
            rng = make_generator("holdout", "configurations", i)
            samples = sample_conditions(starts, args.samples, rng)
            values = objective.values(samples)
            # The best that is possible; the check costs more than the estimate.
            best = next(
                (
                    values[k]
                    for k in np.argsort(-values)
                    if starts.angles(samples.x0[k], samples.p_WR[k], samples.torso_m[k]) is not None
                ),
                -np.inf,
            )
            grid = float(objective.values(starts.grid).max())
            for kind, optimiser in OPTIMISERS.items():
                began = time.perf_counter()
                try:
                    chosen = optimiser(model, method=name).select(
                        Situation(p_WG=p_WG, starts=starts)
                    )
                except RequestError:
                    results[kind].append((best, grid, -np.inf, time.perf_counter() - began))
                    continue
                condition = InitialConditions(
                    chosen.x0[None], chosen.p_WR[None], np.array([chosen.torso_m])
                )
                value = float(objective.values(condition)[0])
                results[kind].append((best, grid, value, time.perf_counter() - began))
        for kind in OPTIMISERS:
            best_of, grid_of, found, seconds = np.array(results[kind]).T
            possible = np.isfinite(best_of)
            lines.append(
                f"| {name} | {kind} | {np.sum(np.isfinite(found[possible]))} of {possible.sum()} |"
                f" {100 * np.mean(found[possible] >= best_of[possible] - 1e-9):.1f} |"
                f" {100 * np.mean(found >= grid_of - 1e-9):.1f} |"
                f" {100 * np.median(found - grid_of):.2f} |"
                f" {np.median(seconds):.2f} | {seconds.max():.2f} |"
            )
            print(lines[-1], flush=True)
    if args.out:
        args.out.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
