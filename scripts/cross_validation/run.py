"""Compares success estimators on environments of a library that their fits never saw.

python scripts/cross_validation/run.py models/experience/cylinder-clutter --out notebooks/results
"""

import csv
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from lic_drake.estimate.cross_validation import (
    calibration_curve,
    hold_out_environments,
    score,
)
from lic_drake.estimate.estimator import Predictor
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.estimate.scikit_learn import PEERS
from lic_drake.experience.store import ExperienceLibrary
from scripts.common import RESULTS, make_parser, run_script

ESTIMATORS: dict[str, Callable[[], Predictor]] = {
    **{name: partial(make_estimator, name) for name in estimator_names()},
    **PEERS,
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
        curve = calibration_curve(held_out.probability, rows.f)
        curves += [{"estimator": name, **asdict(bin_)} for bin_ in curve]
        print(markdown(scores[-1:], HEADINGS).splitlines()[-1], flush=True)
    out.mkdir(parents=True, exist_ok=True)
    write_csv(out / "cross_validation.csv", scores)
    write_csv(out / "calibration_curves.csv", curves)
    (out / "cross_validation.md").write_text(
        f"# Estimators on held-out environments\n\n"
        f"{len(rows.f)} reaches of {library.name} in {len(set(rows.environment))} environments,"
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
