"""Who finds a start: the discrete ones, the lattice, or the program; against random samples.

Attempts are first ones; each situation is another environment and goal of the holdout stream.

    python scripts/selection/run.py --library models/experience/cylinder-clutter
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from lic_drake.estimate.features import features_of
from lic_drake.evaluate.table import Table
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.reach.start import Start, Starts
from lic_drake.seeds import make_generator
from lic_drake.select.lic import LicSelector
from lic_drake.select.program import LicProgram
from lic_drake.select.registry import fit_model
from lic_drake.select.situation import Situation
from lic_drake.starts import FeasibleStarts, Region, make_starts
from scripts.selection.lbfgsb import LbfgsbSelector


class SearchSelector(LicSelector):
    """LIC without any optimisation: the best of discrete starts and lattice."""

    def improve(self, program: LicProgram, region: Region, start: Start) -> Start | None:
        """Returns nothing."""
        return None


class ProgramSelector(LicSelector):
    """LIC without the pattern search."""

    def improve(self, program: LicProgram, region: Region, start: Start) -> Start | None:
        """Returns where the program ends from a start."""
        return program.situation.starts.snap(region, program.solve(region, start))


STAGES = {
    "lattice": SearchSelector,
    "L-BFGS-B": LbfgsbSelector,
    "program": ProgramSelector,
    "program, pattern search": LicSelector,
}
"""What makes a selection."""


def sample(starts: FeasibleStarts, count: int, rng: np.random.Generator) -> Starts:
    """Returns uniform samples of all regions, feasible or not."""
    regions = [starts.regions[i] for i in rng.integers(len(starts.regions), size=count)]
    x0 = np.array([rng.uniform(region.lower, region.upper) for region in regions])
    if not starts.arm.is_planar:
        x0[:, 3:] /= np.linalg.norm(x0[:, 3:], axis=1, keepdims=True)
    return Starts(
        x0, np.array([rng.uniform(region.b0_lower, region.b0_upper) for region in regions])
    )


def best_feasible(program: LicProgram, samples: Starts) -> float:
    """Returns the highest estimate of feasible samples, -inf if there is none."""
    values = program.estimates(samples)
    for k in np.argsort(-values):
        if program.situation.starts.solve(samples.x0[k], samples.b0[k]) is not None:
            return float(values[k])
    return -np.inf


def check_estimator(library: ExperienceLibrary, estimator: str, args: argparse.Namespace) -> Table:
    scenario = library.scenario()
    model = fit_model(estimator, features_of(scenario.category).first, library.columns())
    values: dict[str, list[float]] = {"discrete": [], "samples": [], **{k: [] for k in STAGES}}
    seconds: dict[str, list[float]] = {stage: [] for stage in STAGES}
    for i in range(args.situations):
        starts = make_starts(scenario, scenario.sample_instance("holdout", i))
        situation = Situation(p_WG=scenario.sample_goal("holdout", i), starts=starts)
        program = LicSelector(model).program(situation)
        values["discrete"].append(float(program.estimates(starts.grid).max()))
        rng = make_generator("holdout", "samples", i)
        values["samples"].append(best_feasible(program, sample(starts, args.samples, rng)))
        for stage, kind in STAGES.items():
            began = time.perf_counter()
            chosen = kind(model).select(situation).start
            seconds[stage].append(time.perf_counter() - began)
            assert starts.solve(chosen.x0, chosen.b0, near=chosen.q) is not None
            values[stage].append(float(program.estimates(Starts.of(chosen))[0]))
    best = np.max([values["samples"], *(values[stage] for stage in STAGES)], axis=0)
    rows = []
    for stage, of_stage in values.items():
        behind = 100.0 * (best - of_stage)
        rows.append(
            (
                *(estimator, stage, f"{100 * np.mean(of_stage):.2f}", f"{behind.mean():.2f}"),
                *(
                    f"{behind.max():.2f}",
                    f"{np.median(seconds[stage]):.3f}" if stage in seconds else "",
                ),
            )
        )
    return Table(
        caption=f"{scenario.category}, {args.situations} situations, {args.samples} samples",
        heading=(
            *("estimator", "best of", "mean estimate, %", "behind the best of all, points"),
            *("largest shortfall, points", "median s"),
        ),
        rows=tuple(rows),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=shipped_library("cylinder-clutter"))
    parser.add_argument("--situations", type=int, default=30)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    args = parser.parse_args()
    library = ExperienceLibrary(args.library)
    for estimator in args.estimators:
        print(check_estimator(library, estimator, args).to_markdown(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
