"""Compares features and LIC-2 of the PR2's estimators at held-out goals.

    python scripts/ablation/space_features.py --out notebooks/results/ablation/space_features.md

Each goal of the library is held out in turn, in all environments.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import SPACE_LIC1
from lic_drake.estimate.neighbours import NearestNeighbours
from lic_drake.estimate.registry import make_estimator
from lic_drake.evaluate.statistics import count, mcnemar
from lic_drake.evaluate.table import Table, rate_cells
from lic_drake.experience.pairs import FIRST_PREFIX, SHOWN, pair_reaches
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.types import Vector
from scripts.common import make_parser, run_script, write_report
from scripts.cross_validation.scores import brier_score, calibration_curve, log_loss

Columns = dict[str, NDArray[Any]]

ESTIMATORS = ("gp", "knn")
PLAIN, RELATIVE = "goal, start, roll", "relative"
LOCAL, AGAIN = "LIC-2, local rows", "LIC-1, away from the failed start"
STACKED = (
    "A stacked LIC-2, a second stage on LIC-1's estimate, was deleted, because LIC-1 away from the"
    " failed start does better: 15/297 against 20/297 (gp), 25/312 against 28/312 (knn)."
)
SPARSE_BANDWIDTHS = 1.0
"""Queries further than this from all rows count as sparse, bandwidths of the nearest neighbours."""


FIRSTS = {
    PLAIN: replace(SPACE_LIC1, relative=False, start=(*SPACE_LIC1.start, "start_qx")),
    RELATIVE: SPACE_LIC1,
}
SECOND = replace(FIRSTS[PLAIN], observed=("first_start_y", "first_start_z"))


@dataclass
class HeldOut:
    """What one estimator made of all goals, each held out once.

    Attributes:
        probability: LIC-1's estimates of all reaches by features, shape (n,) each.
        gap: Distance of each reach from the nearest row, in bandwidths, shape (n,) each.
        won: By features, whether the chosen start of each environment and goal succeeds.
        second: By strategy, whether the second start succeeds, for each failure of LIC-1.
        repeated: How often LIC-2 would choose the failed start again if it might.
        random: Success of each other start, on average, for each failure.
    """

    probability: dict[str, Vector]
    gap: dict[str, Vector]
    won: dict[str, list[bool]] = field(default_factory=lambda: {name: [] for name in FIRSTS})
    second: dict[str, list[bool]] = field(
        default_factory=lambda: {name: [] for name in ("possible", AGAIN, LOCAL)}
    )
    repeated: int = 0
    random: list[float] = field(default_factory=list)


def goal_of_each(columns: Columns) -> NDArray[np.intp]:
    """Returns the number of each reach's goal (goal_y, goal_z), shape (n,)."""
    goals = np.round(np.column_stack([columns["goal_y"], columns["goal_z"]]), 6)
    return np.unique(goals, axis=0, return_inverse=True)[1].ravel()


def hold_out_goals(name: str, columns: Columns) -> HeldOut:
    """Predicts first and second reaches to each goal from the reaches to the others."""
    goal, groups = goal_of_each(columns), SPACE_LIC1.rows(columns).groups
    n = len(goal)
    found = HeldOut(
        {key: np.empty(n) for key in FIRSTS}, {key: np.full(n, np.nan) for key in FIRSTS}
    )
    for k in range(int(goal.max()) + 1):
        out = goal == k
        for key, features in FIRSTS.items():
            rows = features.rows(columns)
            X = np.round(rows.X, 9)  # Sums of the same numbers in another order are equal.
            first = make_estimator(name, features).fit(X[~out], rows.y[~out], groups[~out])
            found.probability[key][out] = first.values(X[out])
            found.gap[key][out] = _gap(first, X[~out], X[out])
        pairs = SECOND.rows(pair_reaches({key: v[~out] for key, v in columns.items()}))
        second = make_estimator(name, SECOND).fit(pairs.X, pairs.y, pairs.groups)
        for environment in np.unique(groups[out]):
            here = np.flatnonzero(out & (groups == environment))
            _choose(found, columns, here, second)
        print(f"{name}: {k + 1} of {goal.max() + 1} goals", flush=True)
    return found


def _choose(
    found: HeldOut, columns: Columns, here: NDArray[np.intp], second: SuccessEstimator
) -> None:
    """Adds the first and second choices among the reaches of one environment and goal."""
    won = columns["success"][here].astype(bool)
    for key, probability in found.probability.items():
        found.won[key].append(bool(won[np.argmax(probability[here])]))
    lic1 = found.probability[RELATIVE][here]
    first = int(np.argmax(lic1))
    if won[first]:
        return
    others = np.delete(np.arange(len(here)), first)
    found.random.append(float(won[others].mean()))
    found.second["possible"].append(bool(won.any()))
    found.second[AGAIN].append(bool(won[others[np.argmax(lic1[others])]]))
    failed = here[first]
    shown = {FIRST_PREFIX + key: np.full(len(here), columns[key][failed]) for key in SHOWN}
    X = SECOND.rows({key: v[here] for key, v in columns.items()} | shown).X
    values = second.values(X)
    found.second[LOCAL].append(bool(won[others[np.argmax(values[others])]]))
    found.repeated += int(np.argmax(values) == first)


def _gap(estimator: SuccessEstimator, seen: Vector, asked: Vector) -> Vector:
    """Returns the distance of each query from the nearest row in bandwidths; NaN without any."""
    if not isinstance(estimator, NearestNeighbours):
        return np.full(len(asked), np.nan)
    tree = cKDTree(seen / estimator.bandwidth_)
    return tree.query(asked / estimator.bandwidth_)[0]


def first_table(results: dict[str, HeldOut], f: Vector) -> Table:
    """Returns how good LIC-1's estimates and choices are."""
    rows = []
    for name, found in results.items():
        for key, values in found.probability.items():
            p = np.clip(values, 0.0, 1.0)
            test = mcnemar(np.array(found.won[key]), np.array(found.won[RELATIVE]))
            scores = (f"{brier_score(p, f):.4f}", f"{log_loss(p, f):.3f}")
            rows.append(
                (name, key, *scores, *rate_cells(count(np.array(found.won[key]))), f"{test:.2g}")
            )
    constant = np.full(len(f), f.mean())
    scores = (f"{brier_score(constant, f):.4f}", f"{log_loss(constant, f):.3f}")
    rows.append(("overall rate", "", *scores, "", "", "", ""))
    return Table(
        caption=f"LIC-1's estimates of {len(f)} reaches to goals that were held out, and the start"
        " of highest estimate in each environment at each goal.",
        heading=(
            *("estimator", "features", "Brier score", "log loss", "chosen start succeeds, %"),
            *("Wilson 90 % interval", "count", "McNemar's p against relative"),
        ),
        rows=tuple(rows),
    )


def second_table(results: dict[str, HeldOut]) -> Table:
    """Returns how second starts end after LIC-1 with relative features failed."""
    rows = []
    for name, found in results.items():
        failures = len(found.random)
        for key, won in found.second.items():
            again = str(found.repeated) if key == LOCAL else ""
            rows.append((name, key, *rate_cells(count(np.array(won))), again))
        expected = f"{sum(found.random):.1f}/{failures} expected"
        rows.append((name, "RND", f"{100 * np.mean(found.random):.1f}", "", expected, ""))
    return Table(
        caption="Second starts after LIC-1's failures (relative features), all other starts of the"
        " environment being there; `possible` is where any of them succeeds.",
        remarks=(STACKED,),
        heading=(
            *("estimator", "second start", "success, %", "Wilson 90 % interval", "count"),
            "would repeat the failed start",
        ),
        rows=tuple(rows),
    )


def calibration_table(results: dict[str, HeldOut], f: Vector) -> Table:
    """Returns predicted and observed success, for nearest neighbours also where rows are sparse."""
    rows = []
    for name, found in results.items():
        for key, values in found.probability.items():
            p, gap = np.clip(values, 0.0, 1.0), found.gap[key]
            parts = {"": np.ones(len(f), dtype=bool)}
            if np.all(np.isfinite(gap)):
                sparse = gap > SPARSE_BANDWIDTHS
                parts = {"near": ~sparse, "sparse": sparse}
            for part, among in parts.items():
                for bin_ in calibration_curve(p[among], f[among], num_bins=5):
                    successes = round(bin_.observed * bin_.count)
                    low, high = count(np.arange(bin_.count) < successes).interval()
                    rows.append(
                        (
                            *(name, key, part, f"{bin_.low:.1f}..{bin_.high:.1f}"),
                            *(f"{bin_.predicted:.3f}", f"{bin_.observed:.3f}"),
                            *(f"{low:.3f}..{high:.3f}", str(bin_.count)),
                        )
                    )
    return Table(
        caption="Predicted and observed success at goals that were held out. Nearest neighbours are"
        f" sparse where no row is within {SPARSE_BANDWIDTHS:g} bandwidth.",
        heading=(
            *("estimator", "features", "rows", "prediction", "mean prediction", "observed"),
            *("Wilson 90 % interval", "reaches"),
        ),
        rows=tuple(rows),
    )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--library", type=Path, default=shipped_library("sphere-aperture-clutter"))
    parser.add_argument("--out", type=Path, required=True, help="Markdown file")
    args = parser.parse_args()
    columns = ExperienceLibrary(args.library).columns()
    results = {name: hold_out_goals(name, columns) for name in ESTIMATORS}
    f = columns["success"].astype(float)
    goals, environments = goal_of_each(columns).max() + 1, len(np.unique(columns["environment"]))
    tables = (first_table(results, f), second_table(results), calibration_table(results, f))
    text = (
        "# Features and second stages of the PR2's estimators\n\n"
        f"Made by `python scripts/ablation/space_features.py --out {args.out}` from {len(f)}"
        f" reaches in {environments} environments: {goals} folds, each without one goal.\n\n"
    )
    write_report(args.out, text + "\n".join(table.to_markdown() for table in tables))


if __name__ == "__main__":
    run_script(main)
