"""Compares features, estimators and settings on held-out environments.

python scripts/ablation/run.py models/experience/passage-clutter \
    models/experience/cylinder-clutter --out notebooks/results/cross_validation
"""

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lic_drake.errors import LicError
from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import ExperienceRows, FeatureMap, features_of
from lic_drake.estimate.neighbours import LocalEstimator, NearestNeighbours
from lic_drake.estimate.registry import make_estimator
from lic_drake.estimate.rows import feature_scale, group_folds
from lic_drake.experience.pairs import pair_reaches
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.robots.registry import get_robot
from lic_drake.select.baselines import Hand, corridor_cost
from lic_drake.types import Vector
from scripts.ablation.counts import BinomialProcess, DirichletProcess
from scripts.common import RESULTS, make_parser, run_script
from scripts.cross_validation.scores import log_loss

Columns = dict[str, NDArray[Any]]

SHARPNESS = 20.0
"""Firsts count by exp(20 F) of LIC-1: a start 5 points worse than the best counts a third."""

SMALLEST_WEIGHT = 0.02
"""Firsts that LIC-1 would choose more rarely than this are left out."""

RETRY_DISTANCE_M = 0.1

X0, FINAL = ("first_start_y", "first_start_phi"), ("first_final_x", "first_final_y")
OBSERVED = {
    "x0'": X0,
    "x0', x_inf'": (*X0, *FINAL),
    "x0', x_inf', phi_inf'": (*X0, *FINAL, "first_final_phi"),
    "x0', v_inf'": (*X0, "first_final_vx", "first_final_vy"),
    "x_inf'": FINAL,
}
GP_OBSERVED = ("x0'", "x0', x_inf'", "x0', v_inf'")


class FixedBandwidth(NearestNeighbours):
    """Neighbours with one bandwidth, in standard deviations, for all features."""

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        self.bandwidth = self.share * feature_scale(X)
        super()._fit(X, y, groups, weight)


def small_local_neighbours(features: FeatureMap) -> SuccessEstimator:
    """The local neighbours of the registry with a half of the rows."""
    return LocalEstimator(
        lambda local: NearestNeighbours(neighbours=200, bandwidth=local.length_scale_),
        features.situation,
        size=1000,
    )


def other_features(Z: Vector, x0: Vector) -> dict[str, Vector]:
    """Returns other feature vectors for rows z = (goal_x, goal_y, y, phi), shape (n, ...)."""
    goal, y, phi = Z[:, :2], Z[:, 2:3], Z[:, 3:]
    way = np.arctan2(goal[:, 1:] - y, goal[:, :1] - x0[:, :1])
    arm = get_robot("planar-arm")
    poses, index = np.unique(x0, axis=0, return_inverse=True)
    q = np.array([arm.solve_ik(pose)[0] for pose in poses])[index.ravel()]
    p_WG = np.column_stack([goal, np.zeros(len(goal))])
    cost = [corridor_cost(x0[i : i + 1], p_WG[i], Hand.of(arm))[0] for i in range(len(Z))]
    return {
        "start relative to the goal": np.hstack([goal, y - goal[:, 1:], phi]),
        "angle between hand and goal": np.hstack([goal, y, phi - way]),
        "polar goal": np.hstack(
            [np.linalg.norm(goal, axis=1)[:, None], np.arctan2(goal[:, 1:], goal[:, :1]), y, phi]
        ),
        "joint angles": np.hstack([goal, q]),
        "corridor cost besides": np.hstack([Z, np.array(cost)[:, None]]),
    }


def held_out_values(
    make: Callable[[], SuccessEstimator],
    rows: ExperienceRows,
    fold: NDArray[np.intp],
    asked: NDArray[np.bool_] | None = None,
) -> Vector:
    """Returns unclipped estimates from fits without a row's fold; NaN where not asked."""
    values = np.full(len(rows.y), np.nan)
    for k in range(int(fold.max()) + 1):
        seen, out = fold != k, (fold == k) & (True if asked is None else asked)
        if np.any(out):
            estimator = make().fit(rows.X[seen], rows.y[seen], rows.groups[seen])
            values[out] = estimator.values(rows.X[out])
    return values


class Choices(NamedTuple):
    """Choices among the starts that were tried for one environment, goal and first failure.

    Attributes:
        success: Success of each start, shape (n, s).
        weight: How much each choice counts, shape (n,).
        environment: Shape (n,).
    """

    success: Vector
    weight: Vector
    environment: NDArray[np.int64]

    def share(self, score: Vector) -> Vector:
        """Returns the success of each choice of the best score, shape (n,); ties share."""
        best = score == score.max(axis=1, keepdims=True)
        return np.sum(best * self.success, axis=1) / best.sum(axis=1)

    def mean(self, values: Vector) -> tuple[float, float]:
        """Returns the weighted mean in percent and its standard error over environments."""
        _, index = np.unique(self.environment, return_inverse=True)
        total = np.bincount(index, self.weight * values)
        weight = np.bincount(index, self.weight)
        mean = total.sum() / weight.sum()
        error = np.sqrt(np.sum((total - mean * weight) ** 2)) / weight.sum()
        return 100.0 * float(mean), 100.0 * float(error)


def table_row(
    library: str, reach: str, variant: str, loss: float, results: list[tuple[float, float]]
) -> dict[str, Any]:
    names = ("selected", "difference", "likely_selected", "likely_difference")
    row: dict[str, Any] = {"library": library, "reach": reach, "variant": variant}
    row["log_loss"] = "" if np.isnan(loss) else f"{loss:.4f}"
    for name, result in zip(names, results, strict=False):
        row[name] = f"{result[0]:.1f} ± {result[1]:.1f}"
    return row


def first_reaches(path: Path, columns: Columns, folds: int) -> list[dict[str, Any]]:
    """Compares variants of LIC-1; adds its held-out estimates, costs and folds to the columns."""
    features = features_of(columns["category"][0]).first
    rows = features.rows(columns)
    fold = group_folds(rows.groups, folds)
    x0 = np.column_stack([columns[f"start_{name}"] for name in ("x", "y", "phi")])
    others = other_features(rows.X, x0)
    variants: dict[str, tuple[Callable[[], SuccessEstimator], Vector]] = {
        name: (partial(make_estimator, name), rows.X) for name in ("gp", "knn")
    }
    variants["gp, Dirichlet"] = (DirichletProcess, rows.X)
    variants["gp, binomial"] = (BinomialProcess, rows.X)
    for share in (0.01, 0.2, 0.3):
        name = f"knn, bandwidths of {share} standard deviations"
        variants[name] = (partial(FixedBandwidth, share), rows.X)
    for name, Z in others.items():
        for kind in ("gp", "knn"):
            variants[f"{kind}, {name}"] = (partial(make_estimator, kind), Z)
    values = {
        name: held_out_values(make, replace(rows, X=Z), fold)
        for name, (make, Z) in variants.items()
    }
    values["COST"] = -others["corridor cost besides"][:, -1]
    values["RND"] = np.zeros(len(rows.y))
    columns |= {"_lic1": values["gp"], "_cost": -values["COST"], "_fold": fold}

    order, size = blocks(columns, ("stream", "environment", "goal_x", "goal_y"))
    choices = Choices(
        rows.y[order].reshape(-1, size),
        np.ones(len(order) // size),
        rows.groups[order].reshape(-1, size)[:, 0],
    )
    success = {name: choices.share(v[order].reshape(-1, size)) for name, v in values.items()}
    oracle = choices.success.max(axis=1)
    table = [table_row(path.name, "first", "oracle", np.nan, [choices.mean(oracle)])]
    for name in ("RND", "COST", *variants):
        loss = log_loss(values[name], rows.y) if name in variants else np.nan
        results = [choices.mean(success[name]), choices.mean(success[name] - success["gp"])]
        table.append(table_row(path.name, "first", name, loss, results))
    return table


def second_reaches(path: Path, columns: Columns) -> list[dict[str, Any]]:
    """Compares variants of LIC-2 after failures of LIC-1 and after likely failures."""
    category = features_of(columns["category"][0])
    pairs = pair_reaches(columns)
    size = blocks(columns, ("stream", "environment", "goal_x", "goal_y"))[1]
    estimate = pairs["_lic1"].reshape(-1, size)
    near = np.abs(pairs["start_y"] - pairs["first_start_y"]).reshape(-1, size)
    near_start = near <= RETRY_DISTANCE_M + 1e-9
    own = near_start & np.isclose(pairs["start_phi"], pairs["first_start_phi"]).reshape(-1, size)
    own &= near < 1e-9
    likely = np.exp(SHARPNESS * (estimate - estimate.max(axis=1, keepdims=True)))
    likely = np.sum(likely * own, axis=1) / likely.sum(axis=1)
    likely[likely < SMALLEST_WEIGHT] = 0.0
    chosen = np.sum(estimate * own, axis=1) == estimate.max(axis=1)
    rows = category.first.rows(pairs)
    environment = rows.groups.reshape(-1, size)[:, 0]
    success = rows.y.reshape(-1, size)
    both = [Choices(success, w, environment) for w in (chosen.astype(float), likely)]

    scores = {
        "COST, away from the first": np.where(
            near_start, -np.inf, -pairs["_cost"].reshape(-1, size)
        ),
        "LIC-1, away from the first": np.where(near_start, -np.inf, estimate),
        "LIC-1, any other start": np.where(own, -np.inf, estimate),
    }
    losses = dict.fromkeys(scores, np.nan)
    asked = np.repeat((likely > 0.0) | chosen, size)
    variants: list[tuple[str, str, Callable[[FeatureMap], SuccessEstimator]]] = [
        (f"{kind}, {observed}", observed, partial(make_estimator, kind))
        for kind, all_observed in (("knn", list(OBSERVED)), ("gp", GP_OBSERVED))
        for observed in all_observed
    ]
    variants.append(("knn, x0', 1,000 rows", "x0'", small_local_neighbours))
    for name, observed, make in variants:
        features = replace(category.first, observed=OBSERVED[observed])
        found = held_out_values(
            partial(make, features), features.rows(pairs), pairs["_fold"], asked
        )
        losses[name] = log_loss(found[asked], rows.y[asked])
        scores[name] = np.where(asked, found, 0.0).reshape(-1, size)
        scores[f"{name}, away from the first"] = np.where(near_start, -np.inf, scores[name])
        losses[f"{name}, away from the first"] = np.nan
        print(path.name, name, flush=True)

    others = (success.sum(axis=1) - np.sum(success * own, axis=1)) / (size - 1)
    reference = both[0].share(scores["LIC-1, away from the first"])
    results = {"oracle": success.max(axis=1), "RND, another start": others}
    results |= {name: both[0].share(score) for name, score in scores.items()}
    return [
        table_row(
            path.name,
            "second",
            name,
            losses.get(name, np.nan),
            [
                result
                for choices in both
                for result in (choices.mean(values), choices.mean(values - reference))
            ],
        )
        for name, values in results.items()
    ]


def blocks(columns: Columns, task: tuple[str, ...]) -> tuple[NDArray[np.intp], int]:
    """Returns the order that puts reaches of one task together, and how many they are."""
    codes = [np.unique(columns[name], return_inverse=True)[1].ravel() for name in task]
    _, index = np.unique(np.column_stack(codes), axis=0, return_inverse=True)
    count = np.bincount(index.ravel())
    if np.any(count != count[0]):
        raise LicError("the ablation needs a library that tries the same starts for every goal")
    return np.argsort(index.ravel(), kind="stable"), int(count[0])


HEADINGS = {
    "variant": "variant",
    "log_loss": "log loss",
    "selected": "selected start succeeds, %",
    "difference": "difference, points",
    "likely_selected": "after likely firsts, %",
    "likely_difference": "difference, points",
}
NOTES = {
    "first": "Differences are paired, from `gp`. RND and COST choose among the same starts."
    " `gp-raw`, without means of equal rows, was deleted: -2.5 ± 1.4 points in passages,"
    " 0.0 ± 0.9 in cylinders.",
    "second": (
        "First the share of successes after LIC-1's own failures (its best start on the grid in"
        " held-out environments), then after all failures that it might have had, each counting"
        " by exp(20 F) of its start. Differences are paired, from LIC-1's best start more than"
        " 0.1 m away. `knn` and `gp` are LIC-2 with what is observed of the first reach; without"
        " a remark they choose among all starts, as the selection does."
    ),
}


def write(out: Path, table: list[dict[str, Any]]) -> None:
    out.mkdir(parents=True, exist_ok=True)
    with (out / "ablation.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ["library", "reach", *HEADINGS], restval="")
        writer.writeheader()
        writer.writerows(table)
    text = (
        "# What features, estimators and settings bring\n\n"
        "On environments held out, in ten folds; ± is the standard error over environments. Made by"
        " `python scripts/ablation/run.py models/experience/passage-clutter"
        " models/experience/cylinder-clutter --out notebooks/results/cross_validation`.\n"
    )
    for library, reach in dict.fromkeys((row["library"], row["reach"]) for row in table):
        used = list(HEADINGS.values())[: 4 if reach == "first" else None]
        text += f"\n## {library}, {reach} reach\n\n{NOTES[reach]}\n\n"
        text += f"| {' | '.join(used)} |\n|{' --- |' * len(used)}\n"
        for row in table:
            if (row["library"], row["reach"]) == (library, reach):
                cells = [row.get(key, "") for key in list(HEADINGS)[: len(used)]]
                text += f"| {' | '.join(cells)} |\n"
    (out / "ablation.md").write_text(text, encoding="utf-8")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument(
        "libraries", type=Path, nargs="+", help="libraries that try a grid of starts"
    )
    parser.add_argument("--folds", type=int, default=10, help="groups of environments held out")
    parser.add_argument("--out", type=Path, default=RESULTS / "cross_validation")
    args = parser.parse_args()
    table: list[dict[str, Any]] = []
    for path in args.libraries:
        columns = ExperienceLibrary(path).columns()
        table += first_reaches(path, columns, args.folds)
        write(args.out, table)
        table += second_reaches(path, columns)
        write(args.out, table)


if __name__ == "__main__":
    run_script(main)
