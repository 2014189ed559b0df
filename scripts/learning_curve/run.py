"""Measures success of the selected start in held-out environments against the library's size.

python scripts/learning_curve/run.py
"""

import csv
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import t as student_t

from lic_drake.estimate.estimator import SuccessEstimator
from lic_drake.estimate.features import PLANAR_LIC1, ExperienceRows
from lic_drake.estimate.registry import make_estimator
from lic_drake.estimate.rows import group_folds
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.seeds import make_generator
from scripts.common import RESULTS, make_parser, run_script
from scripts.cross_validation.scores import selection_success

SIZES = (250, 500, 1000, 2000, 4000, 8000, 18900)


@dataclass(frozen=True, kw_only=True)
class LearningPoint:
    """Success of the selected starts after learning from a part of a library.

    Attributes:
        estimator: Name of the estimator.
        size: Number of reaches that it learned from, a mean over the folds.
        value: Mean over held-out environments of the selected starts' share of successes.
        low: Lower end of its 90 % interval.
        high: Upper end.
    """

    estimator: str
    size: int
    value: float
    low: float
    high: float


def learning_point(
    name: str,
    make: Callable[[], SuccessEstimator],
    rows: ExperienceRows,
    size: int,
    folds: int = 10,
) -> LearningPoint:
    """Measures the selection among each held-out environment's starts, learning from `size` rows.

    The rows are drawn from all environments of the other folds. The interval is Student's over
    environments; it does not cover the choice of the rows.

    Args:
        name: Of the estimator.
        make: Returns a new, unfitted estimator.
        rows: Reaches with several starts for each goal of an environment.
        size: Number of reaches to learn from; all of the other folds' if there are fewer.
        folds: Number of groups of environments.
    """
    fold = group_folds(rows.groups, folds)
    probability = np.empty(len(rows.y))
    sizes = []
    for held_out in range(fold.max() + 1):
        out = fold == held_out
        rng = make_generator("training", "learning curve", size, held_out)
        pool = np.flatnonzero(~out)
        part = rng.choice(pool, size=min(size, len(pool)), replace=False)
        sizes.append(len(part))
        estimator = make().fit(rows.X[part], rows.y[part], rows.groups[part])
        probability[out] = estimator.predict_proba(rows.X[out])[:, 1]
    success = selection_success(probability, rows, PLANAR_LIC1.situation)
    mean, n = float(success.mean()), len(success)
    half_width = float(student_t.ppf(0.95, n - 1) * success.std(ddof=1) / np.sqrt(n))
    return LearningPoint(
        estimator=name,
        size=round(float(np.mean(sizes))),
        value=mean,
        low=max(0.0, mean - half_width),
        high=min(1.0, mean + half_width),
    )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--library", type=Path, default=shipped_library("cylinder-clutter"))
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument(
        "--out", type=Path, default=RESULTS / "learning_curve" / "learning_curve.csv"
    )
    args = parser.parse_args()
    rows = PLANAR_LIC1.rows(ExperienceLibrary(args.library).columns())
    args.out.parent.mkdir(parents=True, exist_ok=True)
    with args.out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(LearningPoint.__dataclass_fields__))
        writer.writeheader()
        for name in args.estimators:
            for size in args.sizes:
                point = learning_point(name, partial(make_estimator, name), rows, size)
                writer.writerow(asdict(point))
                print(point, flush=True)


if __name__ == "__main__":
    run_script(main)
