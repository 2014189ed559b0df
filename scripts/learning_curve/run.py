"""Measures success of the selected start in held-out environments against the library's size.

python scripts/learning_curve/run.py --out notebooks/results/learning_curve/learning_curve.csv
"""

import argparse
import sys
from functools import partial
from pathlib import Path

from lic_drake.errors import LicError
from lic_drake.estimate.features import PLANAR_LIC1
from lic_drake.estimate.registry import make_estimator
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from scripts.common import RESULTS
from scripts.learning_curve.curve import LearningPoint, learning_point, write_learning_curves
from scripts.tables.figures import LEARNING_CURVE

SIZES = (250, 500, 1000, 2000, 4000, 8000, 18900)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--library", type=Path, default=shipped_library("cylinder-clutter"))
    parser.add_argument("--estimators", nargs="+", default=["gp", "knn"])
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES)
    parser.add_argument("--out", type=Path, default=RESULTS / LEARNING_CURVE)
    args = parser.parse_args()
    try:
        rows = PLANAR_LIC1.rows(ExperienceLibrary(args.library).columns())
        curves: dict[str, list[LearningPoint]] = {name: [] for name in args.estimators}
        for name, points in curves.items():
            for size in args.sizes:
                make = partial(make_estimator, name)
                points.append(learning_point(make, rows, PLANAR_LIC1.situation, size))
                print(name, points[-1], flush=True)
        write_learning_curves(args.out, curves)
    except LicError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
