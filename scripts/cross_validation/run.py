"""Compares success estimators on held-out environments of a library.

python scripts/cross_validation/run.py models/experience/cylinder-clutter --out notebooks/results
"""

import csv
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from lic_drake.estimate.estimator import SuccessEstimator, from_sklearn
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.estimate.rows import average_rows, reach_variance
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.types import Vector
from scripts.common import RESULTS, make_parser, run_script
from scripts.cross_validation.scores import (
    calibration_curve,
    hold_out_environments,
    score,
)


class MaternProcess(SuccessEstimator):
    """scikit-learn's Gaussian process with a Matern 1/2 kernel, on averaged rows."""

    def _fit(self, X: Vector, y: Vector, groups: Any, weight: Vector) -> None:
        rows = average_rows(X, y, weight)
        # The first constant is the prior variance of the unknown mean rate.
        kernel = ConstantKernel(1.0, "fixed") + ConstantKernel(0.05, (1e-4, 4.0)) * Matern(
            np.ones(X.shape[1]), nu=0.5
        )
        process = GaussianProcessRegressor(kernel, alpha=reach_variance(rows) / rows.count)
        self._scaler = StandardScaler().fit(X)
        self._process = process.fit(self._scaler.transform(rows.X), rows.rate)

    def _values(self, X: Vector) -> Vector:
        return np.asarray(self._process.predict(self._scaler.transform(X)))


def neighbours(k: int) -> SuccessEstimator:
    """Returns scikit-learn's classifier by nearest neighbours; K=5 is its default."""
    return from_sklearn(make_pipeline(StandardScaler(), KNeighborsClassifier(k)))


ESTIMATORS: dict[str, Callable[[], SuccessEstimator]] = {
    **{name: partial(make_estimator, name) for name in estimator_names()},
    "sklearn KNN, K=5": partial(neighbours, 5),
    "sklearn KNN, K=100": partial(neighbours, 100),
    "sklearn GP, Matern 1/2": MaternProcess,
}
HEADINGS = {
    "estimator": "estimator",
    "log_loss": "log loss",
    "gain": "gain over constant",
    "gain_error": "its standard error",
    "brier": "Brier score",
    "selected": "selected start succeeds",
    "selected_error": "its standard error",
    "seconds": "seconds in all",
}


def markdown(rows: list[dict[str, Any]], headings: dict[str, str]) -> str:
    lines = [" | ".join(headings.values()), " | ".join("---" for _ in headings)]
    for row in rows:
        cells = [row[key] for key in headings]
        lines.append(" | ".join(f"{c:.4f}" if isinstance(c, float) else str(c) for c in cells))
    return "".join(f"| {line} |\n" for line in lines)


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def run(library: Path, names: list[str], folds: int, out: Path) -> None:
    rows = PLANAR_LIC1.rows(ExperienceLibrary(library).columns())
    scores: list[dict[str, Any]] = []
    curves: list[dict[str, Any]] = []
    for name in names:
        began = time.perf_counter()
        held_out = hold_out_environments(ESTIMATORS[name], rows, folds=folds)
        seconds = time.perf_counter() - began
        if not scores:
            constant = score(
                replace(held_out, probability=held_out.constant), PLANAR_LIC1.situation
            )
            scores.append({"estimator": "constant rate", **asdict(constant), "seconds": 0.0})
        result = score(held_out, PLANAR_LIC1.situation)
        scores.append({"estimator": name, **asdict(result), "seconds": seconds})
        curve = calibration_curve(held_out.probability, rows.y)
        curves += [{"estimator": name, **asdict(bin_)} for bin_ in curve]
        print(markdown(scores[-1:], HEADINGS).splitlines()[-1], flush=True)
    out.mkdir(parents=True, exist_ok=True)
    write_csv(out / "cross_validation.csv", scores)
    write_csv(out / "calibration_curves.csv", curves)
    (out / "cross_validation.md").write_text(
        f"# Estimators on held-out environments\n\n"
        f"{len(rows.y)} reaches of {library.name} in {len(set(rows.groups))} environments,"
        f" {folds} folds. The constant rate selects a start at random.\n\n"
        + markdown(scores, HEADINGS),
        encoding="utf-8",
    )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("library", type=Path, help="folder or Parquet file of an LIC-1 library")
    parser.add_argument("--estimators", nargs="+", choices=ESTIMATORS, default=list(ESTIMATORS))
    parser.add_argument("--folds", type=int, default=10, help="groups of environments held out")
    parser.add_argument("--out", type=Path, default=RESULTS / "cross_validation")
    args = parser.parse_args()
    run(args.library, args.estimators, args.folds, args.out)


if __name__ == "__main__":
    run_script(main)
