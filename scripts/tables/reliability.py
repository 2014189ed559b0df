"""Tabulates how often choices succeed beside what their estimates promised.

python scripts/tables/reliability.py
"""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np

from lic_drake.evaluate.reliability import FOLDER, Reliability, choices, reliability_of
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import read_trials
from lic_drake.paths import shipped_library
from lic_drake.types import BoolVector, Vector
from scripts.common import run_tables, write_tables

CATEGORIES = {
    "cylinder-clutter": "",
    "passage-clutter": "",
    "cylinder-aperture-clutter": "",
    "sphere-aperture-clutter": "",
    "iiwa14-sphere-aperture-clutter": "",
    "panda-sphere-aperture-clutter": "",
    "foliage-aperture-clutter": "known-foliage",
}
"""Libraries, and the variant of the trials by what was learned from each."""

LEAST = (0.1, 0.2, 0.3, 0.5)
"""Probabilities below which a robot might refuse."""

_DRAWS = 2000


def tabulate(results: Path) -> list[Table]:
    """Returns both tables: successes expected and observed, and what refusing would have meant."""
    expected, refused = [], []
    for category, variant in CATEGORIES.items():
        known = read_trials(shipped_library(category) / FOLDER / "trials.parquet")
        tried = read_trials(results / category / "trials.parquet")
        for method, attempt in product(("gp", "knn"), (1, 2)):
            reliability = reliability_of(known, method, attempt)
            estimates, successes = choices(tried, method, attempt, variant)
            if reliability is None:
                continue
            p, (low, high) = reliability.probabilities(estimates), spread(reliability, estimates)
            name = (category, method, str(attempt))
            numbers = (reliability.count, len(p), round(estimates.sum()))
            calibrated = f"{p.sum():.0f} ({low:.0f}..{high:.0f})"
            expected.append((*name, *map(str, numbers), calibrated, str(successes.sum())))
            refused.append((*name, *(_cell(successes, p < least) for least in LEAST)))
    return [
        Table(
            caption="Successes of the evaluation's attempts: by the estimates alone, by the"
            " estimates calibrated on choices in other environments, with a 90 % interval, and as"
            " observed.",
            heading=(
                *("category", "method", "attempt", "choices", "attempts"),
                *("estimated", "calibrated", "observed"),
            ),
            rows=tuple(expected),
        ),
        Table(
            caption="Attempts that a robot would have refused because their calibrated probability"
            " was lower, %, and how many of those succeeded, %.",
            heading=("category", "method", "attempt", *(f"below {x}" for x in LEAST)),
            rows=tuple(refused),
        ),
    ]


def spread(reliability: Reliability, estimates: Vector) -> tuple[float, float]:
    """Returns the 90 % interval of the number of successes of choices, estimates of shape (n,).

    Both the choices that the calibration comes from and these might have ended otherwise.
    """
    rng = np.random.default_rng(0)
    won = []
    for weights in rng.multivariate_normal(reliability.weights, reliability.covariance, _DRAWS):
        p = replace(reliability, weights=weights).probabilities(estimates)
        won.append(np.sum(rng.uniform(size=len(p)) < p))
    low, high = np.percentile(won, [5.0, 95.0])
    return low, high


def _cell(successes: BoolVector, refused: BoolVector) -> str:
    if not np.any(refused):
        return "0"
    return f"{100 * np.mean(refused):.0f} / {100 * np.mean(successes[refused]):.0f}"


def write(results: Path) -> list[Path]:
    """Writes the tables."""
    return write_tables(results, "reliability", tabulate(results))


if __name__ == "__main__":
    run_tables(write, __doc__)
