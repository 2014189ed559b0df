"""Compares success estimators on environments of a library that their fits never saw.

    python scripts/cross_validate.py models/experience/cylinder-clutter --out notebooks/results
"""

import argparse
import csv
import sys
import time
from pathlib import Path

import numpy as np

from lic_drake.errors import LicError
from lic_drake.estimate.cross_validation import (
    HeldOutPredictions,
    brier_score,
    calibration_curve,
    hold_out_environments,
    log_loss,
    selection_success,
)
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import estimator_names, make_estimator
from lic_drake.estimate.scikit_learn import PEERS
from lic_drake.experience.store import ExperienceLibrary

MAKERS = {name: lambda name=name: make_estimator(name) for name in estimator_names()} | PEERS


def score(name: str, held_out: HeldOutPredictions, seconds: float) -> dict[str, str | float]:
    """Returns an estimator's row of the table."""
    f, gain = held_out.rows.f, held_out.gain_by_environment()
    return {
        "estimator": name,
        "log_loss": log_loss(held_out.probability, f),
        "gain": gain.mean(),
        "gain_standard_error": gain.std(ddof=1) / np.sqrt(len(gain)),
        "brier": brier_score(held_out.probability, f),
        "selected_success": selection_success(
            held_out.probability, held_out.rows, PLANAR_LIC1.situation
        ),
        "seconds": seconds,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=Path, help="folder or Parquet file of an LIC-1 library")
    parser.add_argument("--estimators", nargs="+", choices=list(MAKERS), default=list(MAKERS))
    parser.add_argument("--folds", type=int, default=10, help="groups of environments held out")
    parser.add_argument("--out", type=Path, default=Path("notebooks/results"))
    args = parser.parse_args()
    try:
        rows = PLANAR_LIC1.rows(ExperienceLibrary(args.library).columns())
        scores, curves = [], []
        for name in args.estimators:
            began = time.perf_counter()
            held_out = hold_out_environments(MAKERS[name], rows, folds=args.folds)
            scores.append(score(name, held_out, time.perf_counter() - began))
            curves += [
                {"estimator": name} | vars(bin_)
                for bin_ in calibration_curve(held_out.probability, rows.f)
            ]
            print(", ".join(f"{key} {value}" for key, value in scores[-1].items()), flush=True)
        constant = HeldOutPredictions(
            rows=rows, probability=held_out.constant, constant=held_out.constant
        )
        scores.insert(0, score("constant rate", constant, 0.0))
        write(args.out, args.library.name, scores, curves, describe(args, rows))
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0
